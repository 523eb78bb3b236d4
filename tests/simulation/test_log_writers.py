"""What `simulate` writes, the readers read back, to the format's own precision."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.outputs.conversion import companions, save
from vftcli.readers.reading import read
from vftcli.readers.references import read_reference
from vftcli.robots import load_robot
from vftcli.signals.errors import OutputError, ParameterError
from vftcli.simulation import Simulation, load_scenario, simulate
from vftcli.simulation.scenario import Scenario
from vftcli.simulation.writers import TRUTH_COLUMNS, WRITERS, usual_format

LOSSY = ["duration=2.0", "sensing.repeated=0.02", "sensing.dropped=0.02"]


@pytest.fixture(scope="module")
def ur5() -> Simulation:
    return simulate(load_scenario("ur5-circle", [*LOSSY, "contacts.hand.begin=0.0"]), 1)


@pytest.fixture(scope="module")
def panda() -> Simulation:
    return simulate(load_scenario("panda-bearing", LOSSY), 1)


@pytest.fixture(scope="module")
def sensed() -> Simulation:
    return simulate(load_scenario("ur5-sensor", ["duration=1.0"]), 1)


# absolute tolerance: what the format keeps (nine and six decimals; six significant digits of a
# torque below 100 N·m and an angle below 10 rad; all of a double)
CASES = [
    ("ur5", "rtde", "log.csv", 5e-10),
    ("ur5", "ur-rtde", "log.csv", 5.1e-7),
    ("ur5", "parquet", "log.parquet", 0.0),
    ("ur5", "rosbag2", "bag", 0.0),
    ("panda", "libfranka", "log.csv", 5.1e-5),
    ("panda", "parquet", "log.parquet", 0.0),
    ("panda", "rosbag2", "bag", 0.0),
]


def test_every_writer_is_tried() -> None:
    assert {form for _, form, _, _ in CASES} == set(WRITERS)


@pytest.mark.slow
@pytest.mark.parametrize(("who", "form", "name", "kept"), CASES)
def test_readers_read_back_what_is_written(who, form, name, kept, tmp_path, request) -> None:
    run: Simulation = request.getfixturevalue(who)
    save({tmp_path / name: run}, form)
    back, mine = read(tmp_path / name), run.recording
    assert back.samples == mine.samples
    assert back.source.duplicates == mine.source.duplicates > 0
    # stamps of 100 s in doubles: 1e-14; a bag counts nanoseconds
    np.testing.assert_allclose(back.t, mine.t, atol=2e-9)
    compared = 0
    for signal in ("q", "dq", "current", "torque", "target_q", "target_current", "tau_ext"):
        there, here = getattr(back, signal), getattr(mine, signal)
        if there is not None and here is not None:
            np.testing.assert_allclose(there, here, rtol=0, atol=kept + 1e-15, err_msg=signal)
            compared += 1
    assert compared >= 3


def test_full_recipe_has_the_columns_of_the_client(ur5: Simulation, tmp_path: Path) -> None:
    save({tmp_path / "log.csv": ur5})
    text = (tmp_path / "log.csv").read_bytes()
    header = text.split(b"\r\n")[0].split(b" ")
    assert len(header) == 119  # the client's default recipe
    assert header[0] == b"timestamp"
    assert header[-1] == b"joint_position_deviation_ratio"
    assert all(len(line.split(b" ")) == 119 for line in text.split(b"\r\n")[:-1])


def test_libfranka_log_has_its_columns_and_sign(panda: Simulation, tmp_path: Path) -> None:
    save({tmp_path / "log.csv": panda})
    lines = (tmp_path / "log.csv").read_text().splitlines()
    names = lines[0].split(",")
    assert len(names) == 87
    assert names[:3] == ["time", "success_rate", "state.q[0]"]
    row = [float(v) for v in lines[1].split(",")]
    column = names.index("state.tau_ext_hat_filtered[1]")
    assert row[column] == pytest.approx(-panda.measured.signals["tau_ext"][0, 1], rel=1e-5)
    assert row[0] == 100_000.0


def test_sensor_is_logged_in_every_format(sensed: Simulation, tmp_path: Path) -> None:
    save({tmp_path / "log.csv": sensed})
    header = (tmp_path / "log.csv").read_text().splitlines()[0]
    assert header.endswith("ft_raw_wrench_5")
    for form, name in (("parquet", "log.parquet"), ("rosbag2", "bag")):
        save({tmp_path / name: sensed}, form)
        back = read(tmp_path / name)
        np.testing.assert_array_equal(back.require("wrench"), sensed.measured.signals["wrench"])


def test_truth_is_on_the_clock_of_the_log_and_says_what_its_columns_hold(
    ur5: Simulation, tmp_path: Path
) -> None:
    path = tmp_path / "log.csv"
    save({path: ur5})
    truth, log = read_reference(companions(path)[0], None), read(path)
    assert truth.stamps[0] == pytest.approx(log.source.t0, abs=1e-12)
    np.testing.assert_array_equal(truth.signals["tau_ext"], ur5.truth.tau_ext)
    axes = [f"wrench/{a}" for a in ("fx", "fy", "fz", "mx", "my", "mz")]
    names = list(pl.read_parquet_schema(companions(path)[0]))
    assert names == ["t", *(f"tau_ext/{j}" for j in range(1, 7)), *axes]
    found = json.loads(pl.read_parquet_metadata(companions(path)[0])["vftcli"])
    assert found["columns"] == TRUTH_COLUMNS
    assert found["columns"]["tau_ext"] == "N·m, on the robot"
    assert "base axes, moment about the flange point" in found["columns"]["wrench"]


def test_existing_files_are_kept_unless_forced(ur5: Simulation, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    companions(path)[0].write_text("mine")
    with pytest.raises(OutputError, match="--force"):
        save({path: ur5})
    assert not path.exists()
    save({path: ur5}, force=True)
    save({tmp_path / "bag": ur5}, "rosbag2")
    save({tmp_path / "bag": ur5}, "rosbag2", force=True)
    assert path.exists()
    assert sorted(p.name for p in tmp_path.iterdir() if p.name.startswith(".")) == []


def test_a_bag_that_a_killed_run_left_is_made_anew(ur5: Simulation, tmp_path: Path) -> None:
    """Its folder is there, with no metadata or nothing in it; another folder is left alone."""
    bag = tmp_path / "bag"
    save({bag: ur5}, "rosbag2")
    whole = sorted(path.name for path in bag.iterdir())
    for gone in ("metadata.yaml", "*"):
        for path in bag.glob(gone):
            path.unlink()
        save({bag: ur5}, "rosbag2", force=True)
        assert sorted(path.name for path in bag.iterdir()) == whole
    (bag / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="no bag"):
        save({bag: ur5}, "rosbag2", force=True)


def test_a_robot_logs_only_in_its_own_formats(
    ur5: Simulation, panda: Simulation, tmp_path: Path
) -> None:
    for run, form in ((ur5, "libfranka"), (panda, "rtde"), (panda, "ur-rtde")):
        with pytest.raises(ParameterError, match="--as"):
            save({tmp_path / "log": run}, form)
    with pytest.raises(ParameterError, match="Did you mean rosbag2"):
        save({tmp_path / "log": ur5}, "rosbag")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("robot", "form"), [("ur3e", "rtde"), ("fr3", "libfranka"), ("m1013", "parquet")]
)
def test_an_arm_logs_as_its_vendor_does(robot: str, form: str) -> None:
    assert usual_format(Scenario(name="log"), load_robot(robot)) == form
