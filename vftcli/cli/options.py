"""Options that several commands share: declared once, so that they read alike everywhere."""

from pathlib import Path
from typing import Annotated

import typer

Log = Annotated[
    Path,
    typer.Argument(metavar="LOG", help="A log file or a bag directory; recognised by content."),
]
Logs = Annotated[
    list[Path],
    typer.Argument(metavar="LOG...", help="Log files or bag directories."),
]
Format = Annotated[
    str | None,
    typer.Option(
        "--format", metavar="NAME", help="Skip recognition; `vftcli formats` lists the names."
    ),
]
Columns = Annotated[
    str | None,
    typer.Option(
        metavar="SPEC",
        help="Columns of a table: 't,q:6,dq:6,current:6' in file order, or "
        "'q=joint_pos_{i},tau=eff_{i}' by header.",
    ),
]
RobotName = Annotated[
    str | None,
    typer.Option("--robot", metavar="NAME|FILE", help="Profile, FILE.toml or FILE.urdf."),
]
Interval = Annotated[
    str | None,
    typer.Option(metavar="A:B", help="Use only this time span, in seconds from the first sample."),
]
Observers = Annotated[
    list[str] | None,
    typer.Option("--observer", metavar="NAME", help="Repeatable. Default: fdo gmo kfo-fe kfo-zoh."),
]
Assignments = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="OBSERVER.PARAMETER=VALUE",
        help="Repeatable: gmo.gain=30, gmo.gain=5,3,4,10,10,10, kfo.noise_convention=discrete.",
    ),
]
Friction = Annotated[
    str, typer.Option(metavar="profile|none", help="The robot's friction model, or none.")
]
PayloadName = Annotated[
    str | None,
    typer.Option("--payload", metavar="NAME", help="Mount a [payload.NAME] of the robot file."),
]
AsPrinted = Annotated[
    bool,
    typer.Option("--as-printed", help="The paper's printed formulas, errata and all."),
]
Reference = Annotated[
    str | None,
    typer.Option(
        metavar="REF",
        help="two-cycle, sensor, vendor, zero, or file:PATH.",
    ),
]
RequiredReference = Annotated[
    str,
    typer.Option(
        "--reference",
        metavar="REF",
        help="two-cycle, sensor, vendor, zero, or file:PATH.",
    ),
]
Free = Annotated[
    list[str] | None,
    typer.Option(
        metavar="LOG|A:B",
        help="Motion that nobody touched: another log, two of the same trajectory measure the "
        "floor; or a span of this one.",
    ),
]
ReferenceColumns = Annotated[
    str | None,
    typer.Option(metavar="SPEC", help="Columns of a reference file, as --columns: 't,tau_ext:6'."),
]
WrenchFlag = Annotated[
    bool, typer.Option("--wrench", help="Also the Cartesian wrench, as force on the robot.")
]
Frame = Annotated[
    str | None,
    typer.Option(
        metavar="flange|base|tool|sensor",
        help="Frame of the wrench (default flange; base: base axes, moment about the flange "
        "point). Implies --wrench.",
    ),
]
Solver = Annotated[
    str | None,
    typer.Option(
        metavar="pinv|damped|map",
        help="How torques become a wrench: least squares (default), damped, or with a prior of "
        "50 N and 10 N·m. Implies --wrench.",
    ),
]
Tool = Annotated[
    str | None,
    typer.Option(
        metavar="POSE|NAME",
        help="The tool on the flange: x,y,z[,roll,pitch,yaw] [m, rad], or [tool.NAME] of the robot "
        "file.",
    ),
]
SensorPose = Annotated[
    str | None,
    typer.Option(
        metavar="POSE|NAME|fit",
        help="The force/torque sensor on the flange, likewise; fit estimates it from the log.",
    ),
]
Zero = Annotated[
    list[str] | None,
    typer.Option(
        metavar="A:B|start|LOG",
        help="Unloaded span whose mean wrench is removed, the unloaded start, or a free run. "
        "Repeat A:B to see the drift between spans. Implies --wrench.",
    ),
]
SensorWeight = Annotated[
    bool,
    typer.Option(
        "--sensor-weight",
        help="Weigh the sensor's own tool in the unloaded spans and remove it from its reading.",
    ),
]
Contacts = Annotated[
    bool,
    typer.Option(
        "--contacts",
        help="Also detection delay, false alarms per hour and missed contacts against the "
        "reference.",
    ),
]
TorqueSd = Annotated[
    str | None,
    typer.Option(
        metavar="own|NUMBER(S)",
        help="Joint torque error behind the wrench's band [N·m]; own: the observer's covariance.",
    ),
]
Period = Annotated[
    float | None,
    typer.Option(metavar="S", help="Commanded period of a repeated motion; found if not given."),
]
FreeCycles = Annotated[
    str | None,
    typer.Option(
        "--free-cycles", metavar="1|1,2|1-3", help="Cycles free of contact; found if not given."
    ),
]
Alignment = Annotated[
    str,
    typer.Option(
        metavar="auto|commanded|period|phase|model",
        help="How the two-cycle difference lays free and loaded motion over one another; auto "
        "takes what has the smallest error on this log.",
    ),
]
LowPass = Annotated[
    str,
    typer.Option(
        "--low-pass", metavar="auto|none|HZ", help="Zero-phase low-pass of that difference."
    ),
]
Match = Annotated[
    str | None,
    typer.Option(
        metavar="delay=S|bandwidth=HZ",
        help="Gains that give every observer the same delay or −3 dB bandwidth on every joint.",
    ),
]
GainsFile = Annotated[
    Path | None,
    typer.Option(
        "--set-file", metavar="FILE", help="Gains that `vftcli tune` wrote; --set goes before them."
    ),
]
FreePart = Annotated[
    str | None,
    typer.Option(
        metavar="A:B",
        help="The same as --free A:B: a span of the log that nothing touches.",
    ),
]
Bands = Annotated[
    bool,
    typer.Option("--bands", help="Measure on the free part how far the estimates may be off."),
]
RemoveBias = Annotated[
    str,
    typer.Option(
        "--remove-bias",
        metavar="free-cycle|model|none",
        help="Subtract what the observers read in free motion at the same phase, or a model of it "
        "over position and velocity.",
    ),
]
PublishedTable = Annotated[
    str | None,
    typer.Option("--published", metavar="table1", help="Set the paper's table beside the errors."),
]
Folder = Annotated[
    Path, typer.Option("-o", "--output", metavar="DIR", help="Folder to write into.")
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite what exists.")]
Json = Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")]
