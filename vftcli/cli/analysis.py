"""What commands ask of logs: the choices that they share, and what is made of them."""

import os
from dataclasses import replace
from typing import TYPE_CHECKING

from vftcli.bias.choice import RefinementChoice
from vftcli.cli.console import health_of
from vftcli.cli.options import Talk
from vftcli.free_motion.choice import FreeChoice
from vftcli.observers.choice import ObserverChoice
from vftcli.outputs import OutputChoice
from vftcli.readers.reader import ReadChoice
from vftcli.robots.choice import RobotChoice
from vftcli.signals.option import Anyway, Asked
from vftcli.wrench.choice import AlsoWrench, WrenchChoice

if TYPE_CHECKING:
    from vftcli.pipeline import AnalysisChoice
    from vftcli.readers.library import Library

#: How a log is read, its arm, and the rest but a reference.
OF_LOG = (ReadChoice, RobotChoice)
OF_ANALYSIS = (
    *OF_LOG,
    ObserverChoice,
    FreeChoice,
    RefinementChoice,
    AlsoWrench,
    WrenchChoice,
    Anyway,
    Talk,
)

#: Arrays from this size on have memory of their own, which goes back with them. [bytes]
#:
#: Each page of such memory has to be found and cleared anew: of smaller arrays, which
#: come by the thousand, that took a third of the time of an hour's report and made its
#: peak no lower.
LARGE = 1 << 24

#: The number by which the C library knows the size from which memory is mapped.
MMAP_THRESHOLD = -3


def give_back() -> None:
    """Have freed arrays give their memory back, where the C library has a call for it.

    Otherwise it keeps what it once had, and a long log's peak is the sum of all its stages.
    """
    # Read by pyarrow when it is imported; its own allocator keeps what it once had.
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    import ctypes

    try:
        ctypes.CDLL(None).mallopt(MMAP_THRESHOLD, LARGE)
    except (AttributeError, OSError, TypeError):  # another C library
        return


def choice_for(
    asked: Asked,
    library: "Library",
    *,
    on_screen: bool = False,
    observers: ObserverChoice | None = None,
) -> "AnalysisChoice":
    """What is asked of a command's logs; their health is said."""
    from vftcli.pipeline import choice_of

    if "observer" in asked.words:
        give_back()
    examiner = health_of(library, anyway=asked.anyway, on_screen=on_screen)
    return choice_of(asked, library, examiner, observers)


def outputs_of(asked: Asked) -> OutputChoice:
    """What is written for other programs."""
    extras = tuple(name for name in ("csv", "rrd", "mcap") if asked.words.get(name))
    return replace(asked.of(OutputChoice), extras=extras)
