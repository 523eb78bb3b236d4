"""The real and simulated logs that are sound, with what is truly odd about each."""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import read_chosen
from vftcli.robots import Robot, load_robot
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark

UR10E = "t,q:6,dq:6,current:6,target_current:6,target_torque:6"
PLAIN = "t,q:6,dq:6,current:6,_:12"
FR3 = "t[ns],q:7,dq:7,tau:7,-tau_ext:7,_:13"
PRESS = "t=t,q=q{i},dq=dq{i},tau=tau{i},tau_ext=tau_ext{i}"
FIXTURES = Path(__file__).parents[2] / "fixtures"
BULLET = "t=t,q=q{i},dq=dq{i},-tau=tau{i}"


class SoundLog(NamedTuple):
    """A log of the folder VFT_LOGS, of the samples beside it, or a fixture."""

    path: str  # from VFT_LOGS
    columns: str | None = None  # what ``--columns`` says of it
    robot: str = ""  # the arm's profile, or a robot file of the folder; "" where none is named
    #: How the codes of what is truly odd about it begin; the README of the logs says so.
    known: tuple[str, ...] = ()


def ur10e(name: str, *known: str, columns: str = UR10E) -> SoundLog:
    return SoundLog(f"ur10e/{name}", columns, "ur10e", known)


LOGS: tuple[SoundLog, ...] = (
    ur10e("free_14harm.csv"),
    ur10e("free_14harm.csv", columns=PLAIN),
    ur10e("free_12harm.csv"),
    ur10e("free_12harm.csv", columns=PLAIN),
    ur10e("free_12harm_40s.csv.gz"),
    ur10e("free_10harm.csv.gz"),
    ur10e("free_repeat_a.csv"),
    ur10e("free_repeat_b.csv"),
    ur10e("free_repeat_c.csv"),
    ur10e("jointwise_2.csv"),
    ur10e("jointwise_4.csv"),
    ur10e("load_14harm.csv", "unmodelled-load"),
    ur10e("push_pose.csv"),
    SoundLog("ur10_link4/link4.csv.gz", "t,q:6,dq:6,current:6,_:6", "ur10e"),
    SoundLog("fr3/run_a.npy", FR3, "fr3", ("gaps",)),
    SoundLog("fr3/run_b.npy", FR3, "fr3"),
    SoundLog("panda_exciting", None, "panda"),
    # 29 Hz, a tool that the controller does not know, and in one the wrench is not computed.
    SoundLog("franka_bags/calib_0108.bag", None, "fr3", ("slow-rate", "zero-wrench")),
    SoundLog("franka_bags/calib_0308.bag", None, "fr3", ("slow-rate",)),
    *(
        SoundLog(f"ur3/{name}.bag", "-tau=effort", robot)
        for name in ("identification", "repeat_a", "repeat_b")
        for robot in ("ur3", "")
    ),
    SoundLog("rtde/static_cb3.csv", None, "", ("no-robot-fits",)),
    # It declares a payload that the robot file does not mount.
    *(
        SoundLog(
            "rtde/ur3e_25hz_cr_line_ends.csv", None, robot, ("slow-rate", "payload-not-mounted")
        )
        for robot in ("ur3e", "")
    ),
    SoundLog("rtde/blank_lines.csv", None, "", ("no-robot-fits",)),  # ten samples at rest
    SoundLog("mujoco_ur5e/circle.csv", None, "mujoco_ur5e/robot.toml"),
    SoundLog("libfranka_sim/pushes.csv.gz", None, "libfranka_sim/robot.toml"),
    SoundLog("libfranka_sim/pushes.csv.gz", None, "fr3", ("light-load",)),
    *(
        SoundLog(f"bullet_ur5/{name}.csv.gz", BULLET, "ur5")
        for name in ("free_5", "free_6", "free_7", "pushed_7_const", "pushed_7_vary")
    ),
    SoundLog("ur10e_planted/planted_12harm.csv.gz", UR10E, "ur10e"),
    SoundLog("salerno_ur10/ur10_exciting.db3", "tau=effort", "ur10"),
    *(
        SoundLog(f"panda_press/{name}.csv.gz", PRESS, "panda")
        for name in ("press_1", "press_2", "press_3", "press_4", "press_5", "traj")
    ),
    *(
        # The arm sets a bearing of 9.2 N down at 16.8 s.
        SoundLog(f"../samples/{name}", None, "panda", ("slow-rate", "load-changes"))
        for name in ("droid_raw", "lerobot_v21_effort", "lerobot_v3_effort")
    ),
    SoundLog("../samples/reach/ur5.feather", None, "ur5"),
    SoundLog("../samples/reach/ur5_sec_nsec.csv", None, "ur5"),
    SoundLog("../samples/reach/ur5_position_only.csv", None, "ur5", ("no-velocity",)),
    *(
        SoundLog(str(FIXTURES / name), None, name.split("_")[0], known)
        for name, known in (
            ("ur5_circle.csv", ()), ("ur5_table1.csv", ()), ("ur5_sensor.parquet", ()),
            ("ur5_taps_ur_rtde.csv", ()), ("panda_bearing.csv", ("load-changes",)),
            ("panda_bag", ()),
        )
    ),
    SoundLog(str(FIXTURES / "panda_episodes"), None, "panda", ("slow-rate",)),
)  # fmt: skip


@cache
def robot_of(log: SoundLog, folder: Path) -> Robot | None:
    """The arm that a log is examined for, None where the doctor has to tell it."""
    if not log.robot:
        return None
    return load_robot(folder / log.robot if log.robot.endswith(".toml") else log.robot)


@cache
def recording_of(log: SoundLog, folder: Path) -> Recording:
    path = folder / log.path
    if log.path == "panda_exciting":
        return panda_exciting(path)
    return read_chosen(path, ReadChoice(columns=log.columns, examining=True))


def panda_exciting(folder: Path) -> Recording:
    def numbers(name: str) -> Array:
        return np.loadtxt(folder / f"exciting_traj_{name}.txt").reshape(-1, 7)

    q, dq, torque = (numbers(name) for name in ("positions", "velocity", "torques"))
    return Recording(t=np.loadtxt(folder / "exciting_traj_time.txt"), q=q, dq=dq, torque=torque)


def every(recording: Recording, step: int) -> Recording:
    rows = {name: getattr(recording, name)[::step] for name in ("t", *recording.signals)}
    return replace(recording, **rows)


def parts(recording: Recording) -> Iterator[tuple[str, Recording]]:
    """The log, its halves, its spans of 10 and 20 s and its thinned rows, each with its name."""
    yield "all", recording
    start, length = float(recording.t[0]), recording.duration
    for seconds in (length / 2, 20.0, 10.0):
        count = int(length // seconds)
        for k in range(count if count > 1 else 0):
            first = start + k * seconds
            part = recording.between(first, first + seconds)
            yield f"{first - start:.0f}:{first - start + seconds:.0f}", part
    for rate in (100, 50, 25):
        step = round(1 / (rate * recording.median_step))
        if step > 1 and recording.samples > 20 * step:
            yield f"{rate} Hz", every(recording, step)


def unexpected(log, recording, findings) -> tuple[Remark, ...]:
    """The warnings that nothing known of a log explains."""
    slow = ("slow-rate",) if recording.median_step > 1 / 50 else ()  # thinned below the limit
    known = (*log.known, *slow)
    return tuple(f for f in findings if f.level == "warning" and not f.code.startswith(known))
