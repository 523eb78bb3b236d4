"""Commands that are refused, on tiny logs made for it: what tests of remedies begin with."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import polars as pl
from seed_logs import libfranka_csv
from test_remedies import Command, printed, robot_file, sound
from test_topics import ALPHABETICAL, ur_message, write_joint_states

FIXTURES = Path(__file__).parent.parent / "fixtures"
EPISODES, UR5 = FIXTURES / "panda_episodes", FIXTURES / "ur5_circle.csv"
SENSOR = FIXTURES / "ur5_sensor.parquet"
PLAIN = "t=t,q=q{i},dq=dq{i},current=current{i}"
COUNTED = "t,q:6,dq:6,current:6"
Change = Callable[[pl.DataFrame], pl.DataFrame]


def frame() -> pl.DataFrame:
    return sound().between(0.0, 2.0).frame().select(pl.col("^(t|q.|dq.|current.)$"))


def converted(change: Change, *words: str, name: str = "log.csv", header: bool = True) -> Command:
    """A conversion of a changed log: nothing but the reader works."""

    def command(folder: Path) -> list[Any]:
        return ["convert", written(folder, change, name, header), "-o", "out.csv", *words]

    return command


def written(folder: Path, change: Change, name: str = "log.csv", header: bool = True) -> Path:
    table = change(frame())
    if name.endswith("parquet"):
        table.write_parquet(folder / name)
    else:
        table.write_csv(folder / name, include_header=header, float_precision=9)
    return folder / name


def with_columns(*columns: pl.Expr, **named: pl.Expr) -> Change:
    return lambda table: table.with_columns(*columns, **named)


def renamed(names: dict[str, str]) -> Change:
    """Columns under other names; a name of one letter is of all joints."""
    return lambda table: table.rename(
        lambda c: names.get(c) or re.sub("^([a-z]+)(?=\\d)", lambda m: names.get(m[1], m[1]), c)
    )


def same(table: pl.DataFrame) -> pl.DataFrame:
    return table


def arrays(names: dict[str, tuple[int, ...]], *words: str) -> Command:
    def command(folder: Path) -> list[Any]:
        with h5py.File(folder / "log.hdf5", "w") as file:
            for name, shape in names.items():
                file[name] = np.linspace(0.0, 1.0, int(np.prod(shape))).reshape(shape)
        return ["convert", folder / "log.hdf5", "-o", "out.csv", *words]

    return command


def named_arrays(folder: Path) -> list[Any]:
    table = frame()
    groups = {name: table.select(pl.col(f"^{name}.$")).to_numpy() for name in ("q", "dq")}
    np.savez(folder / "log.npz", t=table["t"].to_numpy(), **groups)
    return ["convert", folder / "log.npz", "-o", "out.csv", "--columns", "t,q:6,dq:6"]


def own_bag(folder: Path) -> list[Any]:
    """A conversion of a bag without a wrench, and of its wrench something is said."""
    assert printed(["convert", written(folder, same), "-o", folder / "log.mcap"])[0] == 0
    return ["convert", folder / "log.mcap", "-o", "out.csv", "--columns", "wrench[base]"]


def without_clock(folder: Path) -> list[Any]:
    """A conversion of an RTDE log without its timestamp, read as what it was."""
    table = pl.read_csv(UR5, separator=" ").head(250).drop("timestamp")
    table.write_csv(folder / "log.csv", separator=" ", float_precision=9)
    return ["convert", folder / "log.csv", "-o", "out.csv", "--set", "log.format=ur-csv"]


def on(log: Change, *words: Any) -> Command:
    """A command on a changed log of a UR5; `words` begin with its name."""
    return lambda folder: [words[0], written(folder, log), *words[1:]]


def estimated(folder: Path, *words: str) -> Path:
    log = written(folder, lambda _: circle().head(500))
    code, said = printed(["estimate", log, "--robot", "ur5", "-o", folder / "made", *words])
    assert code == 0, said
    return folder / "made" / "estimates.parquet"


def judged(reference: Change, header: bool = True) -> Command:
    return lambda f: [
        "compare", written(f, same), *GMO, "--reference",
        f"file:{written(f, reference, 'truth.csv', header)}"]  # fmt: skip


def annotated(*words: str) -> Command:
    return lambda _: ["annotate", EPISODES, "-o", "out", "--robot", "panda", *words]


def mimicking(folder: Path) -> list[Any]:
    text = (FIXTURES / "arm.urdf").read_text("utf-8")
    parts = text.split("</joint>")
    parts[2] += '<mimic joint="' + re.findall('<joint name="([^"]+)"', text)[1] + '"/>'
    (folder / "arm.urdf").write_text("</joint>".join(parts), encoding="utf-8")
    return ["help", "robots", folder / "arm.urdf"]


def xacro(folder: Path) -> list[Any]:
    """A xacro that needs an argument: how heavy its first link is."""
    text = (FIXTURES / "arm.urdf").read_text("utf-8")
    text = re.sub("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ', text, count=1)
    text = re.sub('<mass value="[^"]*"', '<mass value="$(arg heavy)"', text, count=1)
    (folder / "arm.urdf.xacro").write_text(text, encoding="utf-8")
    return ["inspect", written(folder, same), "--robot", folder / "arm.urdf.xacro"]


def gripping(folder: Path) -> list[Any]:
    """An examination with the log's payload, which the log does not say."""
    own = robot_file(folder, more="\n[payload.gripper]\nmass = 1.0\ncom = [0.0, 0.0, 0.05]\n")
    return ["inspect", written(folder, same), "--robot", own, "--payload", "log"]


def circle() -> pl.DataFrame:
    return sound().frame()


def waiting(table: pl.DataFrame) -> pl.DataFrame:
    last = table["t"][3 * len(table) // 4]
    return table.with_columns(t=pl.col("t") + 86400.0 * (pl.col("t") > last))


def short_scenario(folder: Path) -> str:
    text = (FIXTURES / "ur5_circle.csv.scenario.toml").read_text("utf-8")
    text = re.sub("(?m)^duration = .*", "duration = 3.0", text)
    (folder / "short.toml").write_text(text, encoding="utf-8")
    return str(folder / "short.toml")


def edited_header(folder: Path) -> list[Any]:
    path = libfranka_csv(folder / "log.csv")
    path.write_text(path.read_text("utf-8").replace("state.q[3]", "state.x[3]"), encoding="utf-8")
    return ["convert", path, "-o", "out.csv"]


def two_bags(folder: Path) -> list[Any]:
    messages = [
        ur_message(k, name=[f"{side}_{name}" for name in ALPHABETICAL],
                   topic=f"/{side}/joint_states")
        for side in ("left", "right") for k in range(20)
    ]  # fmt: skip
    return ["convert", write_joint_states(folder / "bag", messages), "-o", "out.csv"]


def with_jacobian(table: pl.DataFrame) -> pl.DataFrame:
    """A vendor's torques beside its Jacobian, its axes of length 1, a wrench, no positions."""
    cells = {
        f"jacobian_{row}_{k}": pl.lit(float(row % 3 == k % 3)) if row > 2 else pl.col(f"q{k + 1}")
        for row in range(6) for k in range(6)
    }  # fmt: skip
    axes = zip(("fx", "fy", "fz", "mx", "my", "mz"), range(1, 7), strict=True)
    wrench = {axis: pl.col(f"q{k}") for axis, k in axes}
    torques = {f"tau_ext_{k}": pl.col(f"q{k + 1}") for k in range(6)}
    return table.select("t", **torques, **wrench, **cells)


def two_copies(folder: Path) -> list[Any]:
    """A copy of a dataset with forces, where there is one."""
    words = annotated("--observer", "gmo")(folder)
    assert printed(words)[0] == 0
    return words


GMO = ("--robot", "ur5", "--observer", "gmo")
RELEASE = ("admit", "--release", "x=0.3", "--robot", "ur5")
PULL = renamed({"current": "pull"})
LISTS = pl.concat_list(["t"] * 3)
