"""The options of commands that analyse a log, and what they state together."""

import os
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

from vftcli.bias.choice import RefinementChoice
from vftcli.cli.console import health_of, stages
from vftcli.cli.options import Anyway, Bundle, TalkOptions, Typed, Wrench
from vftcli.evaluation.reference_choice import ReferenceChoice
from vftcli.free_motion.choice import FreeChoice
from vftcli.observers.choice import ObserverChoice
from vftcli.outputs import OutputChoice
from vftcli.readers.reader import ReadChoice
from vftcli.robots.choice import RobotChoice
from vftcli.signals.option import WRITE, Option
from vftcli.wrench.choice import WrenchChoice

if TYPE_CHECKING:
    from vftcli.pipeline import AnalysisChoice
    from vftcli.readers.library import Library

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


class LogOptions(Bundle):
    """How a log is read, and which arm made it."""

    reading: Typed[ReadChoice]
    robot: Typed[RobotChoice]

    def asked(
        self,
        library: "Library",
        *,
        anyway: bool = False,
        on_screen: bool = False,
        **others: Any,  # noqa: ANN401 - choices
    ) -> "AnalysisChoice":
        """What is asked of such a log, its health said, with other choices."""
        from vftcli.pipeline import AnalysisChoice

        return AnalysisChoice(
            read=self.reading.choice(),
            robot=self.robot.choice(),
            library=library,
            examiner=health_of(library, anyway=anyway, on_screen=on_screen),
            **others,
        )


class ExtraOptions(Bundle):
    """What else is written for other programs."""

    mcap: Annotated[
        bool,
        Option("--mcap", "", "Also write estimates.mcap (ROS 2, Foxglove).", group=WRITE),
    ]
    written: Typed[OutputChoice]

    def choice(self, **others: bool) -> OutputChoice:
        """What is written, with what the command's own options ask for."""
        extras = tuple(name for name, asked in {**others, "mcap": self.mcap}.items() if asked)
        return replace(self.written.choice(), extras=extras)


class AnalysisOptions(Bundle):
    """All that can be asked of a log but what it is compared with."""

    log: LogOptions
    observers: Typed[ObserverChoice]
    free: Typed[FreeChoice]
    refinement: Typed[RefinementChoice]
    also_wrench: Wrench
    wrench: Typed[WrenchChoice]
    anyway: Anyway
    talk: TalkOptions

    def choice(
        self,
        library: "Library",
        reference: Typed[ReferenceChoice] | None = None,
        *,
        on_screen: bool = False,
        **observers: Any,  # noqa: ANN401 - words in place of those that are typed
    ) -> "AnalysisChoice":
        """The choice that the options state, a reference's with it where there is one."""
        give_back()
        compared = reference is not None and reference.words["reference"]
        return self.log.asked(
            library,
            anyway=self.anyway,
            on_screen=on_screen,
            observers=self.observers.choice(**observers),
            free=self.free.choice(),
            refinement=self.refinement.choice(),
            contacts=self.refinement.choice().contacts,
            wrench=self.wrench.choice() if self.also_wrench or self.wrench.is_asked else None,
            reference=replace(reference.choice(), contacts=self.talk.details)
            if reference is not None and compared
            else None,
            progress=stages(),
        )
