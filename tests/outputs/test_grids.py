from typing import NamedTuple

import numpy as np

from vftcli.outputs.grid import terminal
from vftcli.outputs.grids import bench_grid, joints_grid, robot_text, robots_grid, tuned_grid
from vftcli.robots import PROFILES, load_robot


class Line(NamedTuple):
    """What a goal finds for one observer, as far as the table shows it."""

    observer: str
    rate: np.ndarray
    delay: np.ndarray
    rmse: np.ndarray
    alarms: np.ndarray | None


def test_the_list_of_robots_fits_a_terminal() -> None:
    head, *lines = terminal(robots_grid(map(load_robot, PROFILES))).splitlines()
    assert head.split() == ["name", "arm", "joints", "effort", "friction"]
    assert max(map(len, lines)) <= 80
    (panda,) = (line.split() for line in lines if line.startswith("panda "))
    assert panda[-3:] == ["7", "link_torque", "sigmoid"]


def test_gains_that_were_found() -> None:
    two = np.array([140.0, 1.5])
    line = Line("gmo", two, 1e-3 * two, 0.5 * two, np.array([0.12345, 2.0]))
    assert terminal(tuned_grid([line], with_alarms=True)).splitlines() == [  # type: ignore[list-item]
        "observer                          J1    J2",
        "gmo       ω [rad/s]              140   1.5",
        "          delay [ms]             140   1.5",
        "          expected rmse [N·m]     70  0.75",
        "          false alarms [1/h]   0.123     2",
    ]
    quiet = terminal(tuned_grid([line], with_alarms=False))  # type: ignore[list-item]
    assert "alarms" not in quiet


def test_a_robot_in_full_has_its_gains_notes_sources_and_payloads() -> None:
    panda = load_robot("panda")
    head, _, *lines = robot_text(panda).splitlines()
    assert head == "Franka Emika Panda (FER) (panda): 7 joints, torque from link_torque"
    table = terminal(joints_grid(panda)).splitlines()
    shown, lines = lines[: len(table)], lines[len(table) :]
    assert shown == table
    assert table[1].split() == ["joint", "[kg]", "[kg·m²]", "[N·m/A]", "[N·m]"]
    assert table[2].split()[:5] == ["joint1", "4.971", "0.000", "–", "87.0"]
    assert table[0].index("tau_max") + len("tau_max") == table[2].index("87.0") + len("87.0")
    *_, friction = (line for line in table if "sigmoid (amplitude 0.54615, " in line)
    assert friction.endswith("; published")
    (note,) = panda.remarks
    assert lines[:8] == [
        "friction: SI units, models in docs/robots.md",
        "",
        "gains of kfo (vftcli help gains):",
        "  kfo.r_diag = [0.08, 0.08, 0.08, 0.08, 0.01, 0.01, 0.01]",
        "  kfo.q_p_diag = [0.05, 0.05, 0.05, 0.05, 0.02, 0.02, 0.02]",
        f"  kfo.q_tau_diag = {[100000.0] * 7}",
        "",
        f"note: {note}",
    ]
    sources = [f"source {name}" for name in ("gaz2019", "franka_description", "fci")]
    assert [line.partition(":")[0] for line in lines[8:-1]] == sources
    assert lines[-1] == "payloads: franka_hand (--payload NAME)"
    assert repr(panda) == "<Robot panda: 7 joints, logs link torque, friction sigmoid>"
    assert "<td>J1 joint1</td>" in panda._repr_html_()
    hand = panda.with_payload(panda.payloads["franka_hand"])
    assert repr(hand).endswith("friction sigmoid, payload 0.73 kg>")


def test_times_are_in_milliseconds_and_microseconds() -> None:
    one = {"total_s": 0.0123456, "per_sample_us": 1.23456, "paper_s": None}
    found = {"dynamics": one, "observers": [{**one, "name": "gmo", "paper_s": 0.5}]}
    assert terminal(bench_grid({**found, "complete_log": []})).splitlines() == [
        "          total [ms]  per sample [µs]  paper, its laptop [s]",
        "dynamics       12.35            1.235                      –",
        "gmo            12.35            1.235                  0.500",
    ]
