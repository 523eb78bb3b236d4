"""Scenario files: every built-in one runs, what is wrong is named."""

import tomllib
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.signals.errors import ParameterError, VftError
from vftcli.simulation import SCENARIOS, load_scenario, scenario, simulate, trajectories
from vftcli.simulation.experiment import simulate_pair
from vftcli.simulation.scenario import Scenario, section_from, to_toml
from vftcli.simulation.trajectories import plan


@pytest.mark.parametrize("name", SCENARIOS)
def test_scenario_runs_and_its_file_makes_it_again(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name, ["duration=0.2"])
    run = simulate(scenario)
    assert scenario.title
    assert np.all(np.isfinite(run.recording.q))
    path = tmp_path / "copy.toml"
    path.write_text(to_toml(scenario), encoding="utf-8")
    assert load_scenario(path) == scenario


@pytest.mark.parametrize("name", SCENARIOS)
def test_scenario_stays_inside_the_limits_of_its_arm(name: str) -> None:
    scenario = load_scenario(name)
    robot = load_robot(scenario.robot)
    t = np.arange(0.0, scenario.trajectory.motion(robot).duration, 0.02)
    reference = plan(scenario.trajectory, robot, t)  # refuses places and speeds beyond them
    assert np.all(np.isfinite(reference))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "duration", "part", "least", "spans"),
    [  # Table III: 20 N, held long enough to drag and not only passed, and 6 N·m
        ("ur5-drag", 20.5, slice(3), 20.0, ((6.3, 8.6), (17.5, 20.2))),
        ("ur5-twist", 28, slice(3, 6), 6.0, ((13.9, 16.0), (25.7, 27.6))),
    ],
)
def test_drags_and_twists_exceed_the_threshold(name, duration, part, least, spans) -> None:
    truth = simulate(load_scenario(name, [f"duration={duration}"])).truth
    for start, stop in spans:  # the hand's in the scenario
        inside = (truth.t > start) & (truth.t < stop)
        above = np.max(np.abs(truth.wrench[inside, part]), axis=1) > least
        assert np.count_nonzero(above) * 0.008 > (0.3 if name == "ur5-drag" else 0.0)


RUNAWAY = "duration=1 servo.damping=200 servo.torque_limits=false friction.enabled=false"


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ("servo.stifness=soft", "Did you mean stiffness"),
        ("servo.stiffness=hard", "there is stiff, soft"),
        ("sensor.rate=3", "no key 'sensor'"),
        ("contacts.hnd.style=taps", "Did you mean hand"),
        ("contacts.hand.kind=push", "Did you mean pushes"),
        ("trajectory.kind=cirlce", "Did you mean circle"),
        ("trajectory={kind='excitation'}", "trajectory.mean is missing"),
        ("step=two", "must be a finite number"),
        ("duration=inf", "finite"),
        ("pair=1", "true or false"),
        ("duration", "is not key=value"),
        ("servo=3", "must be a section"),
        ("title.x=3", "is a value, not a section"),
        ("contacts.hand=3", "contacts is a value, not a section"),
        ("payload.mass=-1", "mass is -1 kg"),
        ("payload.mass=1e9", r"payload.mass is 1e\+09 kg; on a robot it is within"),
        ("duration=-3", "must be positive"),
        ("step=0", "must be positive"),
        ("pair=true contacts=[] duration=0.05", "pair = true needs a payload or contacts"),
        ("friction.temperature_end=200.5", "temperature_end is 200.5 °C; a joint has"),
        ("sensing.start=1.1e10", "a finite number, 1e.10 at most"),
        ("duration=1e9", "shorten it"),
        ("step=0.01 duration=1", "at most 0.001"),
        ("robot=ur55", "no robot 'ur55'"),
        (
            "servo.stiffness=401 duration=1",
            "chatters at a step of 0.001 s; it can be at most 400",
        ),
        ("servo.stiffness=0", "must be positive"),
        ("servo.damping=-0.1", "must be positive and damping not negative"),
        ("contacts.hand.kind=hand", "no key"),
        (RUNAWAY, "runs away"),
        ("contacts.hand.link=9", "0 .flange. to 6"),
        ("contacts.hand.link=-1", "0 .flange. to 6"),
        ("robot=panda trajectory={kind='excitation',mean=[0],cosine=[],sine=[]}", "have 7 numb"),
        ("trajectory.radius=0.6", r"the flange of 'ur5' cannot reach .* \(point \d+ of"),
        ("trajectory.period=1.0", "its limit is 3.14"),
        ("trajectory.radius=0", "must be positive"),
        ("trajectory.period=0", "must be positive"),
        ("trajectory.cycles=0", "must be positive"),
        ("trajectory.start=[0,0,0]", "has 3 angles"),
        ("robot=panda trajectory.start=[] trajectory.period=4", "joint 1 .* would move at"),
        ("trajectory.start=[6.2,-1.35,1.9,-2.1,-1.57,0]", "joint 1 of .ur5. would move over"),
        ("sensing.dropped=1.0", "share from 0 to 1"),
        ("sensing.repeated=-0.1", "share from 0 to 1"),
        *(
            (f"sensing.{name}=-0.1", f"{name} is -0.1; it must not be negative")
            for name in ("rate", "noise", "current_noise", "position_step", "jitter")
        ),
        ("sensing.torque=peak", "average or instant"),
        ("sensing.clock_drift=-0.5", "below 0.5"),
        ("sensing.vendor_cutoff=0.0", "vendor_cutoff positive"),
        ("friction.presliding=1.2", "friction.presliding is 1.2; it is a share, 0 to 1"),
        ("friction.presliding=-0.1", "friction.presliding is -0.1"),
        ("friction.presliding_length=0.0", "friction.presliding_length is 0 rad"),
        ("friction.stribeck_velocity=1e-300", "friction.stribeck_velocity is 1e-300 rad/s"),
        ("force_sensor={mass=-1.0}", r"force_sensor\.mass is -1 kg"),
        ("force_sensor={tool_mass=-1.0}", r"force_sensor\.mass is -1 kg"),
    ],
)
def test_impossible_experiments_are_refused(overrides: str, words: str) -> None:
    with pytest.raises(VftError, match=words):
        simulate_pair(load_scenario("ur5-circle", overrides.split()))


LEFT_OUT = """
Scenario = {robot = "ur5", seed = 1, step = 1e-3, columns = "full"}
ServoSpec = {stiffness = "stiff", damping = 0.8, feed_forward = true, torque_limits = true}
FrictionSpec = {enabled = true, stribeck_velocity = 0.05, presliding_length = 3e-4}
MismatchSpec = {}
PayloadSpec = {}
ForceSensorSpec = {position = [0, 0, 0.03], com = [0, 0, 0.02], tool_com = [0, 0, 0.03]}
SensingSpec = {torque = "average", noise = 1, position_step = 5e-6, vendor_cutoff = 5, start = 100}
ProfileSpec = {rise = 0.2, fall = 0.2}
PushesSpec = {style = "slow", vertical = 0.5}
HandSpec = {reach = 0.6, release = 0.08, stiffness = 200, damping = 15}
StopSpec = {normal = [0, 0, 1], stiffness = 2e4, damping = 200}
CircleSpec = {radius = 0.2, period = 4, cycles = 5}
HoldSpec = {length = 10}
ExcitationSpec = {period = 10, cycles = 2}
"""


@pytest.mark.parametrize(("kind", "stated"), tomllib.loads(LEFT_OUT).items())
def test_what_a_file_leaves_out_is_off_but_for_these(
    kind: str, stated: dict[str, object]
) -> None:
    """An old file makes the same log again: what it does not say has not moved."""
    section = getattr(scenario, kind, None) or getattr(trajectories, kind)
    needed = [f.name for f in fields(section) if f.default is f.default_factory is MISSING]
    made = vars(section(**dict.fromkeys(needed, ())))
    own = {k: v for k, v in made.items() if k != "kind" and not is_dataclass(v)}
    found = {k: v for k, v in own.items() if v is not None and np.any(v)}
    assert found.keys() == stated.keys()
    assert all(np.array_equal(value, stated[name]) for name, value in found.items())


def test_unknown_scenario_lists_them(tmp_path: Path) -> None:
    usual = "free-excitation.*panda-bearing.*payload-pair.*static-poses.*ur5-circle"
    with pytest.raises(ParameterError, match=rf"{usual}.*Did you mean ur5-circle\?"):
        load_scenario("ur5-cirle")
    with pytest.raises(ParameterError, match="cannot be read"):
        load_scenario(tmp_path / "none.toml")


LOAD = "[[contacts]]\nname='a'\nkind='profile'\nspans=[[0.0,1.0]]\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name = 'x'\n[servo]\nstiffness = ", "not valid TOML"),
        ("[trajectory]\nradius = 0.2\n", "trajectory.kind ''"),
        ("[[contacts]]\nkind = 'profile'\nname = 'l'\n", "contacts.0..spans is missing"),
        (f"duration = 0.1\n{LOAD}{LOAD}", "two contacts are named 'a'"),
    ],
)
def test_broken_files_are_refused(text: str, words: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=words):
        simulate(load_scenario(path))


def test_words_with_quotes_survive_the_file() -> None:
    scenario = section_from(Scenario, {"name": 'a"b\\c', "title": "two\nlines"}, "")
    again = section_from(Scenario, tomllib.loads(to_toml(scenario)), "")
    assert again == scenario
