"""Data sets written into a copy of HDF5 episodes, beside their positions."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from vftcli.batch.annotation import open_dataset
from vftcli.batch.datasets import ForceColumn
from vftcli.batch.datasets.hdf5 import Hdf5Dataset, files_below
from vftcli.signals.errors import LogError

TORQUE = ForceColumn("external_torque", ("a", "b"), {"units": "N·m", "causal": True})
VALID = ForceColumn("external_torque_valid", (), {})


def aloha(path: Path) -> Path:
    with h5py.File(path, "w") as content:
        for k in (0, 1):
            content[f"data/demo_{k}/observations/qpos"] = np.zeros((5 + k, 7))
        content.attrs["mine"] = "kept"
    return path


def test_each_episode_gets_its_own(tmp_path: Path) -> None:
    path = aloha(tmp_path / "set.hdf5")
    before = path.read_bytes()
    dataset = open_dataset(path)
    (file,) = dataset.files()
    assert (file.episodes, file.place) == ((0, 1), Path("set.hdf5"))
    assert [dataset.frames(file, k) for k in (0, 1)] == [5, 6]
    forces = {
        k: {
            "external_torque": np.full((5 + k, 2), k, np.float32),
            "external_torque_valid": np.ones((5 + k, 1), np.float32),
        }
        for k in (0, 1)
    }
    dataset.write(file, [TORQUE, VALID], forces, tmp_path / "out.hdf5")
    assert path.read_bytes() == before
    with h5py.File(tmp_path / "out.hdf5") as content:
        data = content["data/demo_1/observations/external_torque"]
        assert (data.shape, data.dtype) == ((6, 2), np.float32)
        assert (data.attrs["units"], bool(data.attrs["causal"])) == ("N·m", True)
        assert data.attrs["names"].tolist() == ["a", "b"]
        assert content["data/demo_0/observations/external_torque_valid"].shape == (5,)
        assert content.attrs["mine"] == "kept"
    again = open_dataset(tmp_path / "out.hdf5")
    with pytest.raises(LogError, match="has data/demo_0/observations/external_torque already"):
        again.check_new(next(iter(again.files())), [TORQUE])


def test_files_are_found_at_any_depth_and_places_by_columns(tmp_path: Path) -> None:
    (tmp_path / "b" / "c").mkdir(parents=True)
    for name in ("b/c/trajectory.h5", "a.hdf5"):
        with h5py.File(tmp_path / name, "w") as content:
            content["arm/angles"] = np.zeros((4, 6))
    (tmp_path / "b" / "x.mp4").write_text("")
    assert [str(p.relative_to(tmp_path)) for p in files_below(tmp_path)] == [
        "a.hdf5", "b/c/trajectory.h5"
    ]  # fmt: skip
    dataset = Hdf5Dataset(tmp_path, None, "t@50Hz,q=arm/angles")
    file = next(iter(dataset.files()))
    assert dataset.frames(file, 0) == 4
    own = {0: {"external_torque": np.zeros((4, 2), np.float32)}}
    dataset.write(file, [TORQUE], own, tmp_path / "out.h5")
    with h5py.File(tmp_path / "out.h5") as content:
        assert "arm/external_torque" in content
