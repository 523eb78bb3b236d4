"""The log doctor on logs made to be ill, and on real ones."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.doctor import Examination, FindingWords, examine, finding_record, in_words
from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import read, read_first_recording
from vftcli.robots import Payload, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording


def moving(robot: str, *, load: float = 0.0, seconds: float = 10.0, seed: int = 0) -> Recording:
    """A log of an arm that moves by its own profile's dynamics, with Coulomb friction.

    Torque by the momentum equation: ṗ by central differences of p, so exact to the order of the
    step squared.
    """
    arm = load_robot(robot)
    if load:
        arm = arm.with_payload(
            Payload(mass=load, com=np.array([0, 0, 0.05]), inertia=np.zeros((3, 3)))
        )
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, 0.004)
    n = arm.joints
    rate, phase = rng.uniform(1, 2, n), rng.uniform(0, 6, n)
    centre = rng.uniform(-1, 1, n)
    q = centre + 0.6 * np.sin(np.outer(t, rate) + phase)
    dq = 0.6 * rate * np.cos(np.outer(t, rate) + phase)
    terms = momentum_terms(arm.loaded_chain, q, dq)
    drive = np.gradient(terms.p, t, axis=0) - terms.coriolis_transpose_dq + terms.gravity
    drive = drive + 4.0 * np.tanh(dq / 0.01)
    torque = {"torque": drive}
    if arm.torque_constant is not None:
        torque = {"current": drive / arm.torque_constant}
    return Recording(t=t, q=q, dq=dq, **torque)


def names(examination: Examination) -> set[str]:
    return {finding.name for finding in reported(examination)}


def reported(examination: Examination) -> list[FindingWords]:
    return [in_words(finding) for finding in examination.findings]


@pytest.mark.parametrize("robot", ["ur5", "ur5e", "ur10e", "panda", "fr3"])
def test_a_sound_log_is_assigned_to_its_robot(robot: str) -> None:
    examination = examine(moving(robot))
    assert examination.robots[0].robot == robot
    assert examination.robots[0].fits
    assert examination.robots[0].misfit < 0.05
    assert examination.warnings == ()


def test_an_unknown_load_is_found() -> None:
    examination = examine(moving("ur5e", load=3.0))
    assert examination.robots[0].robot == "ur5e"
    assert "unmodelled-load" in names(examination)
    # friction 4 N·m and inertial forces of the load are not in the fit of its weight
    assert examination.robots[0].load == pytest.approx(3.0, abs=0.3)


def altered(recording: Recording, **changes: Array | None) -> Examination:
    return examine(replace(recording, **changes))  # type: ignore[arg-type]


@pytest.mark.slow
def test_inverted_effort_is_reported_and_what_to_do() -> None:
    log = moving("ur10e")
    assert log.current is not None
    examination = altered(log, current=-log.current)
    finding = next(f for f in reported(examination) if f.name == "effort-sign")
    assert "leading minus" in finding.remedy
    assert "twice" in finding.consequence
    assert not examination.robots[0].fits


@pytest.mark.slow
def test_effort_that_is_current_is_reported() -> None:
    log = moving("ur5e")
    examination = altered(log, torque=log.current, current=None)
    (said,) = [f for f in reported(examination) if f.name == "torque-as-current"]
    assert "--set log.effort=current" in said.remedy


def test_milliamperes_are_reported() -> None:
    log = moving("ur5e")
    assert log.current is not None
    assert "milliamperes" in names(altered(log, current=1000 * log.current))


def test_units_and_signs_of_velocity() -> None:
    log = moving("panda")
    assert log.dq is not None
    assert "velocity-unit" in names(altered(log, dq=np.rad2deg(log.dq)))
    assert "velocity-sign" in names(altered(log, dq=-log.dq))
    assert not {"velocity-unit", "velocity-mismatch"} & names(examine(log))


@pytest.mark.slow
def test_velocity_in_radians_beside_positions_in_degrees_is_another_unit() -> None:
    """The slope is then 1/57.3: reported as a unit, not as a wrong velocity of every joint."""
    log = moving("panda")
    found = names(altered(log, q=np.rad2deg(log.q)))
    assert "velocity-unit" in found
    assert "velocity-mismatch" not in found


def test_a_finding_holds_its_numbers_for_machines() -> None:
    log = moving("ur5")
    gap = log.t + np.where(np.arange(log.samples) > 1000, 0.5, 0.0)
    (finding,) = [f for f in altered(log, t=gap).findings if f.code == "gaps"]
    record = finding_record(finding)
    assert record["values"]["longest_s"] == pytest.approx(0.504)
    assert record["values"]["at_s"] == pytest.approx(4.0)
    assert (record["level"], record["severity"], record["name"]) == ("warning", "warning", "gaps")
    assert json.loads(json.dumps(record)) == record


def test_signals_that_are_not_there() -> None:
    log = moving("panda")
    assert "no-velocity" in names(altered(log, dq=None))
    assert "no-effort" in names(altered(log, torque=None))
    zeros = np.zeros((log.samples, 6))
    examination = altered(log, wrench=zeros)
    assert "zero-wrench" in names(examination)


def test_saturation_and_still_joints() -> None:
    log = moving("ur5")
    assert log.current is not None
    limit = 0.85 * np.abs(log.current[:, 1]).max()
    assert "saturation" in names(altered(log, current=np.clip(log.current, -limit, limit)))
    q = log.q.copy()
    q[:, 4] = 0.3
    assert "still-joints" in names(altered(log, q=q))


def test_clock_findings() -> None:
    log = moving("ur5")
    jitter = log.t + np.random.default_rng(1).uniform(0, 2e-3, log.samples)
    assert "jitter" in names(altered(log, t=jitter))
    gap = log.t + np.where(np.arange(log.samples) > 1000, 0.5, 0.0)
    assert "gaps" in names(altered(log, t=gap))
    assert "slow-rate" in names(altered(log, t=10 * log.t))
    assert "too-short" in names(examine(log.between(0, 0.005)))


def test_an_arm_without_profile() -> None:
    rng = np.random.default_rng(3)
    t = 0.01 * np.arange(500)
    log = Recording(t=t, q=rng.normal(size=(500, 4)), dq=rng.normal(size=(500, 4)))
    assert "no-profile" in names(examine(log))


def test_every_finding_has_evidence_consequence_and_remedy() -> None:
    log = moving("ur10e", seconds=3.0)
    assert log.current is not None
    for finding in reported(altered(log, current=-log.current, dq=None)):
        assert finding.evidence
        assert finding.consequence
        assert finding.remedy
        assert "\n" not in str(finding)


TABLE_31 = "t,q:6,dq:6,current:6,target_current:6,target_torque:6"
FR3 = "t[ns],q:7,dq:7,tau:7,-tau_ext:7,_:13"
ARMS = {
    "ur10e/free_12harm.csv": (TABLE_31, "ur10e"),
    "ur10e/free_14harm.csv": (TABLE_31, "ur10e"),
    "ur10e/free_repeat_a.csv": (TABLE_31, "ur10e"),
    "ur10e/free_repeat_b.csv": (TABLE_31, "ur10e"),
    "ur10e/free_repeat_c.csv": (TABLE_31, "ur10e"),
    "ur10e/jointwise_2.csv": (TABLE_31, "ur10e"),
    "ur10e/jointwise_4.csv": (TABLE_31, "ur10e"),
    "ur10e/load_14harm.csv": (TABLE_31, "ur10e"),
    "ur10e/push_pose.csv": (TABLE_31, "ur10e"),
    "fr3/run_a.npy": (FR3, "fr3"),
    "fr3/run_b.npy": (FR3, "fr3"),
    "franka_bags/calib_0108.bag": (None, "fr3"),
    "franka_bags/calib_0308.bag": (None, "fr3"),
    "ur3/identification.bag": (None, None),
    "ur3/repeat_a.bag": (None, None),
    "ur3/repeat_b.bag": (None, None),
    "rtde/static_cb3.csv": (None, None),
    "other_robot_yu_cobot.parquet": (None, None),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS)
def test_real_logs_are_assigned_to_their_robot_or_to_none(logs: Path, name: str) -> None:
    columns, robot = ARMS[name]
    examination = examine(read_first_recording(logs / name, ReadChoice(columns=columns)))
    assert [fit.robot for fit in examination.robots if fit.fits] == ([robot] if robot else [])
    assert ("no-robot-fits" in names(examination)) == (robot is None)


def test_panda_exciting_is_a_panda(logs: Path) -> None:
    folder = logs / "panda_exciting"

    def numbers(name: str) -> Array:
        return np.loadtxt(folder / f"exciting_traj_{name}.txt").reshape(-1, 7)

    log = Recording(
        t=np.loadtxt(folder / "exciting_traj_time.txt"),
        q=numbers("positions"),
        dq=numbers("velocity"),
        torque=numbers("torques"),
    )
    examination = examine(log)
    assert [fit.robot for fit in examination.robots if fit.fits] == ["panda"]
    assert "stale-rows" in names(examination)  # the README of the logs counts 1145 repeated rows


@pytest.mark.slow
@pytest.mark.parametrize("name", ["identification", "repeat_a", "repeat_b"])
def test_ur3_effort_is_inverted(logs: Path, name: str) -> None:
    examination = examine(read(logs / "ur3" / f"{name}.bag"))
    finding = next(f for f in reported(examination) if f.name == "effort-sign")
    assert "J1, J2, J3, J4, J5, J6" in finding.evidence
    assert "--columns -tau" in finding.remedy
    turned = examine(read(logs / "ur3" / f"{name}.bag", columns="-tau=effort"))
    assert "effort-sign" not in names(turned)


def test_payload_mismatch_of_the_static_log(logs: Path) -> None:
    examination = examine(read(logs / "rtde" / "static_cb3.csv"))
    finding = next(f for f in reported(examination) if f.name == "payload-mismatch")
    assert "J2" in finding.evidence
    assert "J3" in finding.evidence


def test_load_of_the_loaded_log(logs: Path) -> None:
    examination = examine(read(logs / "ur10e" / "load_14harm.csv", columns=TABLE_31))
    finding = next(f for f in reported(examination) if f.name == "unmodelled-load")
    assert "2.88 ±" in finding.evidence  # 2.805 kg were mounted; the currents say 2.88
    assert finding.severity == "warning"


def test_zero_wrench_of_the_bag(logs: Path) -> None:
    examination = examine(read(logs / "franka_bags" / "calib_0108.bag"))
    assert "zero-wrench" in {in_words(finding).name for finding in examination.warnings}
