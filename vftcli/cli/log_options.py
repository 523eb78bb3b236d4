"""The options that say what a log is and which arm made it; as in `vftcli.cli.options`."""

from typing import TYPE_CHECKING

from vftcli.cli import help as headings
from vftcli.cli.bundles import ChoiceBundle, option

if TYPE_CHECKING:
    from vftcli.readers.reader import ReadChoice
    from vftcli.robots.choice import RobotChoice

Words = list[str] | None  #: The values of an option that may be repeated.

ROBOT = ("--robot", "NAME|FILE", "Profile, FILE.toml, or a URDF, xacro or MJCF.")
TIP = (
    "--tip",
    "FRAME",
    "Link or joint at the arm's end, in a description with hands or several arms; the wrench "
    "stands at a link that is fixed to the last one.",
)
ROBOT_ARG = (
    "--robot-arg",
    "NAME=VALUE",
    "An argument of a xacro, which is a program. Repeatable.",
)


class ReadOptions(ChoiceBundle["ReadChoice"]):
    """How a log is read, and which part of it."""

    GROUP = headings.LOG
    HOME = "readers.reader:ReadChoice"

    format: str | None = option(
        "--format", "NAME", "Skip recognition; `vftcli formats` lists the names.", seldom=True
    )
    columns: str | None = option(
        "--columns",
        "SPEC",
        "Columns of a table (vftcli help columns). 't,q:6,dq:6,current:6' in file order, or "
        "'q=joint_pos_{i},tau=eff_{i}' by header.",
    )
    interval: str | None = option(
        "--interval", "A:B", "Only this span, in seconds from the first sample."
    )
    effort: str | None = option(
        "--effort",
        "auto|current|torque|torque-without-gravity",
        "What the log's effort is, whatever it is called; auto takes what the robot's model "
        "explains best, and says so.",
        seldom=True,
    )
    episode: str | None = option(
        "--episode",
        "K|all",
        "Of a file that holds several: which, or each as a log of its own.",
        seldom=True,
    )
    arm: str | None = option("--arm", "left|right", "Of a log of two arms: which.", seldom=True)
    derive: str | None = option(
        "--derive",
        "dq|none",
        "Velocities from the positions over the complete log, in place of logged ones; where the "
        "log has none, from 50 Hz on, they are derived unasked, and that is said.",
        seldom=True,
    )


class RobotOptions(ChoiceBundle["RobotChoice"]):
    """Which arm, and how it is modelled."""

    GROUP = headings.LOG
    HOME = "robots.choice:RobotChoice"

    robot: str | None = option(*ROBOT)
    friction: str | None = option(
        "--friction",
        "profile|none|model",
        "The robot file's friction (default), none, or what an MJCF gives for simulation.",
        seldom=True,
    )
    payload: str | None = option(
        "--payload",
        "NAME",
        "Mount a [payload.NAME] of the robot file; log: the one that the log declares.",
        seldom=True,
    )
    tip: str | None = option(*TIP, seldom=True)
    robot_arg: Words = option(*ROBOT_ARG, seldom=True)
