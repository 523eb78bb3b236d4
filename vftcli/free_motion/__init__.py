"""Ground truth: references for the estimates, each with its error if known.

Here is the user's choice of free motion.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Self

from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.option import LOG, Choice, Option, interval

AUTOMATIC = "auto"  #: The word for what is chosen by the log at hand.

SPAN = re.compile(r"[-+.\d]*:[-+.\d]*")  #: Two times with a colon, in any order.
#: Most digits of a cycle's number: 99 999 cycles of a second take a day.
DIGITS = 5


def cycle_numbers(text: str) -> tuple[int, ...]:
    """Cycle numbers, counted from 1, of ``1`` or ``1,2`` or ``1-3``."""
    found: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        short = max(len(first), len(last)) <= DIGITS
        if not short or not first.isdecimal() or (dash and not last.isdecimal()):
            raise ReferenceTorqueError(
                f"two-cycle.free-cycles={text} is no list of cycle numbers as 1 or 1,2 or 1-3"
            )
        found += range(int(first), int(last or first) + 1)
    if not found or min(found) < 1:
        raise ReferenceTorqueError(
            f"two-cycle.free-cycles={text} names no cycle; they begin at 1"
        )
    return tuple(dict.fromkeys(found))


def cutoff(text: str) -> float | str | None:
    """Cutoff of ``two-cycle.low-pass``: a number [Hz], None for "none", else the word."""
    if text == "none":
        return None
    try:
        return float(text)
    except ValueError:
        return text


class FreeChoice(Choice):
    """Free motion, and its use in the two-cycle difference."""

    GROUP = LOG

    #: Free runs in other logs.
    logs: Annotated[
        tuple[Path, ...],
        Option(
            "--free",
            "LOG|A:B",
            "Name contact-free motion: a log or seconds A:B. Repeatable.",
            str,
            several=True,
        ),
    ] = ()
    #: Free spans of the log itself, from and to. [s]
    spans: tuple[tuple[float, float], ...] = ()
    #: The commanded period, None to go by the positions alone. [s]
    period: Annotated[
        float | None,
        Option("two-cycle.period", "S", "Commanded period of a repeated motion; else found."),
    ] = None
    #: Its free cycles, counted from 1; none to find them.
    cycles: Annotated[
        tuple[int, ...],
        Option(
            "two-cycle.free-cycles",
            "1|1,2|1-3",
            "Contact-free cycles; default: found.",
            cycle_numbers,
        ),
    ] = ()
    alignment: Annotated[
        str,
        Option(
            "two-cycle.alignment",
            "auto|commanded|period|phase|model",
            "How free and pushed motion are aligned; auto: with the smallest error.",
        ),
    ] = AUTOMATIC
    #: Cutoff of the two-cycle difference [Hz], None for none, or "auto".
    low_pass: Annotated[
        float | str | None,
        Option(
            "two-cycle.low-pass", "auto|none|HZ", "Zero-phase low-pass of the difference.", cutoff
        ),
    ] = AUTOMATIC

    def __post_init__(self) -> None:
        if self.period is not None and not self.period > 0.0:
            raise ReferenceTorqueError(
                f"two-cycle.period={self.period:g} is not a positive time in seconds"
            )
        if self.alignment == "commanded" and self.period is None:
            raise ReferenceTorqueError(
                "alignment commanded needs the commanded period: add --set two-cycle.period=S"
            )
        numeric = self.low_pass is not None and self.low_pass != AUTOMATIC
        if numeric and not (isinstance(self.low_pass, float | int) and self.low_pass > 0.0):
            raise ReferenceTorqueError(
                f"two-cycle.low-pass={self.low_pass} is not a positive cutoff in Hz, none or auto"
            )

    @property
    def is_given(self) -> bool:
        """Whether the user stated the free part."""
        return bool(self.logs or self.spans or self.cycles)

    @classmethod
    def parsed(
        cls,
        *,
        free: Sequence[str | Path] | None = None,
        **words: Any,  # noqa: ANN401 - texts and numbers
    ) -> Self:
        """The choice by a command's options, each the word after its option.

        A word of `free` is a log or a span ``A:B``; a notebook's may be a `Recording`.
        """
        spans, logs = [], list[Any]()
        for word in free or ():
            # What reads as a span is one: a file may be ./A:B.
            try:
                spans.append(interval(str(word)))
            except ParameterError:
                if SPAN.fullmatch(str(word)):
                    raise
                logs.append(Path(word) if isinstance(word, str) else word)
        return replace(super().parsed(**words), logs=tuple(logs), spans=tuple(spans))
