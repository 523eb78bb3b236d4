"""A user's choice of free motion, read from the command line, checked once."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.parsing import interval

AUTOMATIC = "auto"  #: The word for what is chosen by the log at hand.
#: Rungs of the alignment ladder, from the lowest; `vftcli.repetition.ladder.RUNGS` makes them.
ALIGNMENTS = ("commanded", "period", "phase", "model")


@dataclass(frozen=True, kw_only=True)
class FreeChoice:
    """Free motion, and its use in the two-cycle difference.

    With nothing chosen the free cycles of a repeated motion are found.

    Raises:
        ReferenceTorqueError: If an alignment does not exist or lacks its period, a period or cutoff
            is not positive, or cycles are named beside other logs.
    """

    logs: tuple[Path, ...] = ()  #: Free runs in other logs.
    spans: tuple[tuple[float, float], ...] = ()  #: Free spans of the log itself, from and to. [s]
    #: The commanded period of a repeated motion, None to go by the positions alone. [s]
    period: float | None = None
    cycles: tuple[int, ...] = ()  #: Its free cycles, counted from 1; none to find them.
    alignment: str = AUTOMATIC  #: One of `ALIGNMENTS`, or "auto" for the best for the log at hand.
    #: Cutoff of the two-cycle difference [Hz], None for none, or "auto".
    low_pass: float | str | None = AUTOMATIC

    def __post_init__(self) -> None:
        if self.alignment not in {AUTOMATIC, *ALIGNMENTS}:
            raise ReferenceTorqueError(
                f"no alignment {self.alignment!r}; there is auto, {', '.join(ALIGNMENTS)}"
            )
        if self.logs and (self.cycles or self.period is not None):
            raise ReferenceTorqueError(
                "--period and --free-cycles are for cycles of one log; leave them away with --free"
            )
        if self.period is not None and not self.period > 0.0:
            raise ReferenceTorqueError(
                f"--period {self.period:g} is not a positive time in seconds"
            )
        if self.alignment == "commanded" and self.period is None:
            raise ReferenceTorqueError(
                "alignment commanded needs the commanded period: add --period S"
            )
        numeric = self.low_pass is not None and self.low_pass != AUTOMATIC
        if numeric and not (isinstance(self.low_pass, float | int) and self.low_pass > 0.0):
            raise ReferenceTorqueError(
                f"--low-pass {self.low_pass!r} is not a positive cutoff in Hz, none or auto"
            )

    @property
    def is_given(self) -> bool:
        """Whether the user said what is free; then nothing of it is doubted."""
        return bool(self.logs or self.spans or self.cycles)

    @property
    def is_asked(self) -> bool:
        """Whether any free motion, or the period of one, is named."""
        return self.is_given or self.period is not None

    @classmethod
    def parsed(
        cls,
        *,
        free: Sequence[str | Path] | None = None,
        free_part: str | None = None,
        period: float | None = None,
        free_cycles: str | None = None,
        alignment: str = AUTOMATIC,
        low_pass: str = AUTOMATIC,
    ) -> "FreeChoice":
        """The choice that the options of a command state, each the word after its option.

        A word of `free` is a log or a span ``A:B``, as `free_part` is.

        Raises:
            ParameterError: If a span is malformed.
            ReferenceTorqueError: If cycles, alignment or cutoff are not what there is.
        """
        spans, logs = [] if free_part is None else [interval(free_part)], []
        for word in free or ():
            # What reads as a span is one: a file of such a name can be given as ./A:B.
            try:
                spans.append(interval(str(word)))
            except ParameterError:
                logs.append(Path(word))
        return cls(
            logs=tuple(logs),
            spans=tuple(spans),
            period=period,
            cycles=cycle_numbers(free_cycles) if free_cycles is not None else (),
            alignment=alignment,
            low_pass=cutoff(low_pass),
        )


#: Most digits of a cycle's number: at a second each, a log of 99 999 cycles takes a day.
DIGITS = 5


def cycle_numbers(text: str) -> tuple[int, ...]:
    """Cycle numbers, counted from 1, of ``1`` or ``1,2`` or ``1-3``."""
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        short = max(len(first), len(last)) <= DIGITS
        if not short or not first.isdecimal() or (dash and not last.isdecimal()):
            raise ReferenceTorqueError(
                f"--free-cycles {text!r} is not a list of cycle numbers such as 1 or 1,2 or 1-3"
            )
        found += range(int(first), int(last or first) + 1)
    if not found or min(found) < 1:
        raise ReferenceTorqueError(f"--free-cycles {text!r} names no cycle; they count from 1")
    return tuple(dict.fromkeys(found))


def cutoff(text: str) -> float | str | None:
    """Cutoff of ``--low-pass``: a number [Hz], None for "none", else the word."""
    if text == "none":
        return None
    try:
        return float(text)
    except ValueError:
        return text
