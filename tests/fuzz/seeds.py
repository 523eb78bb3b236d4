"""The seeds: a small sound file of every kind, made in code, and the heads of sample files."""

import os
import pickle
import shutil
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from long_mutants import long_seeds
from message_mutants import mcap_messages, shrunk_database, write_mcap
from tokens import Seed

sys.path.insert(0, str(Path(__file__).parents[1] / "readers"))
import seed_containers
import seed_logs
from test_lerobot import dataset

MOST = 60
"""Rows or messages of a seed: an input should cost some tens of milliseconds."""

FAMILIES = {
    "ur-csv": "table", "ur-rtde": "table", "libfranka-csv": "table", "libfranka-csv-old": "table",
    "table": "table", "table-gz": "table", "headerless": "table", "libfranka-json": "lines",
    "ur-binary": "records", "npy": "npy", "npz": "npz", "pickle": "pickle", "parquet": "parquet",
    "arrow": "arrow", "arrow-stream": "arrow", "json": "json", "json-skills": "json",
    "json-lines": "lines", "mat": "mat", "mat-struct": "mat", "hdf5": "hdf5", "aloha": "hdf5",
    "mat-73": "hdf5", "rosbag1": "bag",
    "rosbag1-lz4": "bag", "db3": "folder", "mcap": "mcap", "mcap-json": "mcap",
}  # fmt: skip
"""Seed of the reader tests → the mutator that knows its structure."""

TENSOR = 'ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"'
GAINS = """[observers.gmo]
gain = [10.0, 10.0, 10.0, 10.0, 10.0, 10.0]
[observers.fdo]
omega = 10.0
[observers.kfo]
r_diag = 0.1
q_p_diag = 0.01
q_tau_diag = [10.0, 10.0, 10.0, 10.0, 10.0, 10.0]
noise_convention = "density"
"""


def urdf() -> str:
    """A serial arm of six revolute joints."""
    parts = ['<robot name="arm"><link name="l0"/>']
    parts += [
        f'<link name="l{k}"><inertial><origin xyz="0 0 0.1" rpy="0 0 0"/>'
        f'<mass value="{8 - k}.5"/><inertia {TENSOR}/></inertial></link>'
        f'<joint name="j{k}" type="revolute"><parent link="l{k - 1}"/><child link="l{k}"/>'
        f'<origin xyz="0 0 0.3" rpy="0.1 0 0"/><axis xyz="0 {k % 2} {1 - k % 2}"/>'
        '<limit lower="-6" upper="6" velocity="3" effort="150"/></joint>'
        for k in range(1, 7)
    ]
    return "\n".join([*parts, "</robot>"])


def with_hand() -> str:
    """The arm with a hand of two sliding fingers, the second a follower, and a head beside it."""
    parts = [
        '<link name="tool0"/>',
        '<link name="head"/>',
        '<joint name="mount" type="fixed"><parent link="l6"/><child link="tool0"/></joint>',
        '<joint name="pan" type="revolute"><parent link="l0"/><child link="head"/></joint>',
    ]
    follows = '<mimic joint="left" multiplier="-1" offset="0"/>'
    parts += [
        f'<link name="{k}_finger"><inertial><mass value="0.05"/><inertia {TENSOR}/></inertial>'
        f'</link><joint name="{k}" type="prismatic"><parent link="tool0"/>'
        f'<child link="{k}_finger"/><axis xyz="0 1 0"/>{more}</joint>'
        for k, more in (("left", ""), ("right", follows))
    ]
    return urdf().replace("</robot>", "\n".join([*parts, "</robot>"]))


def mjcf() -> str:
    """The same arm in the language of MuJoCo."""
    arm = "".join(
        f'<body name="b{k}" pos="0 0 0.3" quat="1 0.1 0 0"><inertial mass="1.5" pos="0 0 0.1" '
        f'diaginertia="0.02 0.02 0.02"/><joint name="j{k}" axis="0 {k % 2} {1 - k % 2}" '
        'armature="0.1" damping="1" range="-6 6"/>'
        for k in range(1, 7)
    )
    site = '<site name="attachment_site" pos="0 0 0.1"/>'
    return f'<mujoco model="arm"><worldbody>{arm}{site}{"</body>" * 6}</worldbody></mujoco>'


def make_seeds(folder: Path) -> list[Seed]:
    """Write every seed into a folder; polars runs here, so call it in a process of its own."""
    seeds = [*seeds_in_code(folder), *robot_seeds(folder), *long_seeds(folder)]
    logs = os.environ.get("VFT_LOGS")
    samples = Path(logs).parent / "samples" if logs else None
    if samples is not None and samples.is_dir():
        seeds += sample_seeds(samples, folder)
    return [s._replace(model=mcap_messages(s.path)) if s.family == "mcap" else s for s in seeds]


def seeds_in_code(folder: Path) -> Iterator[Seed]:
    for name, family in FAMILIES.items():
        if name in seed_containers.NEED_H5PY and find_spec("h5py") is None:
            continue
        make, columns = (seed_logs.SEEDS | seed_containers.SEEDS)[name]
        yield Seed(name, family, make(folder / name), columns)
    for version in (2, 3):
        path = dataset(folder / f"set{version}", version=version)
        yield Seed(f"lerobot-{version}", "dataset", path)
    if find_spec("h5py") is not None:
        seed_containers.droid(folder / "droid" / "a")
        seed_containers.droid(folder / "droid" / "b")
        yield Seed("droid", "dataset", folder / "droid")
    yield Seed("jacobian", "table", jacobian_table(folder / "jacobian.csv"))
    for storage in ("sqlite3", "mcap"):
        path = seed_logs.rosbag2(folder / f"rosbag2-{storage}", storage=storage)
        yield Seed(f"rosbag2-{storage}", "folder", path)


def jacobian_table(path: Path) -> Path:
    """Torques beside a Jacobian and a sensor's wrench, without positions."""
    rng = np.random.default_rng(17)
    J = rng.standard_normal((MOST, 6, 7))
    J[:, 3:] /= np.linalg.norm(J[:, 3:], axis=1)[:, None]
    wrench = rng.standard_normal((MOST, 6))
    parts = [
        np.arange(MOST) / 80,
        np.einsum("tij,ti->tj", J, wrench),
        J.reshape(MOST, 42),
        wrench,
    ]
    names = ["timestamp", *(f"tau_ext_{j}" for j in range(7))]
    names += [f"jacobian_{r}_{c}" for r in range(6) for c in range(7)]
    names += ["fx", "fy", "fz", "mx", "my", "mz"]
    table = np.column_stack(parts)
    np.savetxt(path, table, "%.9g", delimiter=",", header=",".join(names), comments="")
    return path


def robot_seeds(folder: Path) -> Iterator[Seed]:
    import vftcli.robots
    import vftcli.simulation.scenario

    for name in ("ur5", "panda"):
        path = folder / f"{name}.toml"
        shutil.copyfile(vftcli.robots.PROFILES[name], path)
        yield Seed(f"robot-{name}", "robot", path)
    for name, family, file, text in (
        ("urdf", "urdf", "arm.urdf", urdf()),
        ("urdf-hand", "urdf", "hand.urdf", with_hand()),
        ("mjcf", "mjcf", "arm.mjcf.xml", mjcf()),
        ("gains", "gains", "gains.toml", GAINS),
    ):
        (folder / file).write_text(text, encoding="utf-8")
        yield Seed(name, family, folder / file)
    for name in ("ur5-circle", "panda-bearing", "ur5-sensor"):
        path = folder / f"{name}.scenario.toml"
        shutil.copyfile(vftcli.simulation.scenario.FOLDER / f"{name}.toml", path)
        yield Seed(f"scenario-{name}", "scenario", path)


def sample_seeds(samples: Path, folder: Path) -> Iterator[Seed]:
    """The heads of the sample files, whatever kinds there are."""
    for path in sorted(samples.rglob("*")):
        name = "-".join(path.relative_to(samples).parts)
        target = folder / f"sample-{name}"
        if path.suffix in {".csv", ".jsonl"}:
            family, most = ("table", MOST + 1) if path.suffix == ".csv" else ("lines", MOST // 2)
            lines = path.read_bytes().splitlines(keepends=True)
            target.write_bytes(b"".join(lines[:most]))
            yield Seed(name, family, target)
        elif path.suffix == ".npz":
            np.savez(target, **{key: value[:MOST] for key, value in np.load(path).items()})
            yield Seed(name, "npz", target)
        elif path.suffix == ".pkl":
            log = pickle.loads(path.read_bytes())
            if isinstance(log, dict):
                log = {k: v[:MOST] if isinstance(v, list) else v for k, v in log.items()}
            target.write_bytes(pickle.dumps(log))
            yield Seed(name, "pickle", target)
        elif path.suffix == ".parquet" and "truth" not in name and "meta" not in name:
            import pyarrow.parquet as pq

            pq.write_table(pq.read_table(path).slice(0, MOST), target)
            yield Seed(name, "parquet", target)
        elif path.suffix == ".bin":
            head = path.read_bytes()
            target.write_bytes(head[: head.index(b"\n", head.index(b"\n") + 1) + 40_000])
            yield Seed(name, "records", target)
        else:
            yield from bag_seeds(path, name, target)


def bag_seeds(path: Path, name: str, target: Path) -> Iterator[Seed]:
    if path.suffix in {".mcap", ".db3"} and (path.parent / "metadata.yaml").is_file():
        shutil.copytree(path.parent, target)
        for file in [target, *target.iterdir()]:
            file.chmod(0o755)
        if path.suffix == ".db3":
            shrunk_database(path, target / path.name, MOST)
        yield Seed(name, "folder", target)
    elif path.suffix == ".mcap":
        try:
            write_mcap(target, mcap_messages(path)[:MOST])
        except Exception:  # noqa: BLE001 - one cut on purpose is none to start from
            return
        yield Seed(name, "mcap", target)
    elif path.suffix in {".bag", ".active"} and "trunc" not in name:
        shutil.copyfile(path, target)
        target.chmod(0o644)
        yield Seed(name, "bag", target)
