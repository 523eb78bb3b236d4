"""A user's choice of free motion, read from the command line, checked once."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Self

from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.option import LOG, Choice, Option
from vftcli.signals.parsing import interval

AUTOMATIC = "auto"  #: The word for what is chosen by the log at hand.
#: Rungs of the alignment ladder, from the lowest; `vftcli.repetition.ladder.RUNGS` makes them.
ALIGNMENTS = ("commanded", "period", "phase", "model")


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


@dataclass(frozen=True, kw_only=True)
class FreeChoice(Choice):
    """Free motion, and its use in the two-cycle difference.

    With nothing chosen the free cycles of a repeated motion are found.

    Raises:
        ReferenceTorqueError: If an alignment does not exist or lacks its period, a period or cutoff
            is not positive, or cycles are named beside other logs.
    """

    GROUP = LOG

    #: Free runs in other logs.
    logs: Annotated[
        tuple[Path, ...],
        Option(
            "--free",
            "LOG|A:B",
            "Motion that nobody touched: another log, or a span. Repeatable: two free runs of the "
            "same trajectory measure the floor.",
            str,
            several=True,
        ),
    ] = ()
    #: Free spans of the log itself, from and to. [s]
    spans: Annotated[
        tuple[tuple[float, float], ...],
        Option(
            "--free-part",
            "A:B",
            "The same as --free A:B; without either, the log's own free cycles are found.",
            str,
            seldom=True,
        ),
    ] = ()
    #: The commanded period of a repeated motion, None to go by the positions alone. [s]
    period: Annotated[
        float | None,
        Option(
            "--period",
            "S",
            "Commanded period of a repeated motion; found if not given.",
            seldom=True,
        ),
    ] = None
    #: Its free cycles, counted from 1; none to find them.
    cycles: Annotated[
        tuple[int, ...],
        Option(
            "--free-cycles",
            "1|1,2|1-3",
            "Cycles free of contact; found if not given.",
            cycle_numbers,
            seldom=True,
        ),
    ] = ()
    alignment: Annotated[
        str,
        Option(
            "--alignment",
            "auto|commanded|period|phase|model",
            "How the two-cycle difference lays free and loaded motion over one another; auto takes "
            "what has the smallest error on this log.",
            seldom=True,
            shows_default=True,
        ),
    ] = AUTOMATIC
    #: Cutoff of the two-cycle difference [Hz], None for none, or "auto".
    low_pass: Annotated[
        float | str | None,
        Option(
            "--low-pass",
            "auto|none|HZ",
            "Zero-phase low-pass of that difference.",
            cutoff,
            seldom=True,
            shows_default=True,
        ),
    ] = AUTOMATIC

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
        **words: Any,  # noqa: ANN401 - texts and numbers
    ) -> Self:
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
        return replace(super().parsed(**words), logs=tuple(logs), spans=tuple(spans))
