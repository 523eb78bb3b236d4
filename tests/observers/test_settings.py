"""Where observer parameters come from: the command line, the robot file, a file of gains, and what
is left over; and what goes over what."""

import os
from pathlib import Path

import numpy as np
import pytest

from vftcli.observers import ObserverChoice
from vftcli.observers.table import (
    PAPER,
    Setup,
    build_observers,
    load_gains,
    overlay_gains,
    parse_settings,
)
from vftcli.robots import PROFILES, load_robot
from vftcli.signals.errors import ParameterError, VftError


def setup(robot: str, *assignments: str, joints: int = 6, step: float = 0.008) -> Setup:
    gains = load_robot(robot).gains if robot else {}
    settings = parse_settings(assignments)
    return Setup(gains=gains, settings=settings, joints=joints, step=step, as_printed=False)


def test_the_profile_gives_the_papers_gains() -> None:
    (fdo, gmo, fe, _), remarks = build_observers(PAPER, setup("ur5"))
    assert fdo.omega == 10.0
    np.testing.assert_array_equal(gmo.gain, [5, 3, 4, 10, 10, 10])
    np.testing.assert_array_equal(fe.r_diag, [0.5, 0.5, 0.5, 1.3, 1.3, 1.3])
    assert remarks == ()


def test_the_command_line_wins_over_the_profile() -> None:
    (gmo, zoh), _ = build_observers(
        ["gmo", "kfo-zoh"],
        setup("ur5", "gmo.gain=30", "kfo.r_diag=1,2,3,4,5,6", "kfo-zoh.decay=2"),
    )
    np.testing.assert_array_equal(gmo.gain, [30.0] * 6)
    np.testing.assert_array_equal(zoh.r_diag, [1, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(zoh.decay, [2.0] * 6)


def test_gains_nobody_gave_take_the_kalman_filters_delay_and_say_so() -> None:
    (fdo, gmo, fe), remarks = build_observers(
        ["fdo", "gmo", "kfo-fe"],
        setup("panda", "kfo.noise_convention=density", joints=7, step=0.001),
    )
    delay = fe.tuning(0.001, 7).delay
    np.testing.assert_allclose(gmo.tuning(0.001, 7).delay, delay, rtol=1e-12)
    np.testing.assert_allclose(1.0 / fdo.omega, np.mean(delay), rtol=1e-12)
    given = {remark.values.get("parameter"): remark.code for remark in remarks}
    assert given["gmo.gain"] == "gain-from-kalman-delay"


@pytest.mark.parametrize("name", ["kfo-fe", "kfo-zoh", "kfo-rts"])
def test_a_file_s_noise_is_a_sample_s_and_a_bare_robot_s_a_density(name: str) -> None:
    """ω_n of R .5 and Q_τ 5000 at 125 Hz: (Q_τ/R)^¼ of densities, (Q_τ/(R·Ts))^¼ of samples."""
    expected = {"ur5": (5000 / 0.5 / 0.008) ** 0.25, "": 10.0}
    for robot, omega in expected.items():
        (observer,), _ = build_observers([name], setup(robot))
        assert observer.tuning(0.008, 6).omega_n[0] == pytest.approx(omega, rel=1e-12)
        (observer,), _ = build_observers([name], setup(robot, "kfo.noise_convention=density"))
        assert observer.tuning(0.008, 6).omega_n[0] == pytest.approx(10.0, rel=1e-12)

    own = {"kfo": {**load_robot("ur5").gains["kfo"], "noise_convention": "density"}}
    (named,), _ = build_observers([name], setup("ur5")._replace(gains=own))
    assert named.tuning(0.008, 6).omega_n[0] == pytest.approx(10.0, rel=1e-12)


def test_the_print_runs_its_own_convention_and_says_so() -> None:
    (fe,), _ = build_observers(["kfo-fe"], setup("ur5")._replace(as_printed=True))
    assert fe.noise_convention == "literal"


def test_what_a_log_would_tune_and_first_order_gains_keep_to_densities() -> None:
    """Delay of the Panda's density reading at 1 kHz: 41.8 and 24.7 ms, not 7.1 and 4.1 ms."""
    panda = setup("panda", joints=7, step=0.001)
    names = ["best", "kfo-auto", "rts-auto", "fdo", "gmo"]
    (best, auto, smoother, fdo, gmo), _ = build_observers(names, panda)
    (density,), _ = build_observers(
        ["kfo-zoh"], setup("panda", "kfo.noise_convention=density", joints=7, step=0.001)
    )
    wanted = density.tuning(0.001, 7)
    for observer in (best, auto, smoother):
        np.testing.assert_array_equal(observer.tuning(0.001, 7).omega_n, wanted.omega_n)
    delay = np.array([0.0418] * 4 + [0.0247] * 3)
    np.testing.assert_allclose(1.0 / gmo.gain, delay, atol=5e-5)  # printed to 0.1 ms
    assert 1.0 / fdo.omega == pytest.approx(delay.mean(), abs=5e-5)


def test_a_bare_robot_gets_ten_per_second_and_is_reported() -> None:
    (gmo,), remarks = build_observers(["gmo"], setup(""))
    np.testing.assert_array_equal(gmo.gain, [10.0] * 6)
    assert [remark.code for remark in remarks] == ["gain-from-default"]
    # From 2/Ts on a first-order observer alternates; at 4 Hz that is 8 1/s.
    (gmo,), _ = build_observers(["gmo"], setup("", step=0.25))
    np.testing.assert_array_equal(gmo.gain, [8.0] * 6)


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("gmo.gain", "is not OBSERVER.PARAMETER=VALUE"),
        ("gmo.gian=3", "Did you mean gain"),
        ("gm.gain=3", "Did you mean gmo"),
        ("gmo.gain=fast", "is not a number"),
        ("gmo.gain=1,nan,3,4,5,6", "must be finite"),
        ("gmo.gain=1,2,3", r"gmo\.gain has 3 values; give one, or one for each of 6"),
    ],
)
def test_a_malformed_assignment_says_what_is_wrong(assignment: str, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        build_observers(["gmo"], setup("ur5", assignment))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("not toml", "gains.toml: not valid TOML"),
        ("gain = 1.0", r"no \[observers"),
        ("[observers]\ngain = 1.0", "line 2: gain is 1.0; it must be a section"),
        ("[observers.gmoo]\ngain = 1.0", "Did you mean gmo"),
        ("[observers.gmo]\ngian = 1.0", "Did you mean gain"),
        ("[observers.gmo]\ngain = true", "line 2: gain is True; it must be a number or one"),
        ('[observers.gmo]\ngain = [1, "2"]', r"line 2: gain is \[1, '2'\]; it must be a number"),
        ("[observers.gmo]\ngain = [nan]", r"line 2: gain is \[nan\]; it must be a number"),
        ("[observers.fdo]\nomega = 1e20", r"1e\+20 is out of range; .* to 1e\+06 in size"),
        ("[observers.kfo]\nr_diag = 5e-324", "kfo.r_diag: 5e-324 is out of range"),
        ("[observers.kfo]\nr_diag = 1e300", r"kfo.r_diag: 1e\+300 is out of range"),
        ("[observers.kfo]\nnoise_convention = 3", "must be text in quotes"),
        (f"x = {'[' * 5000}", "gains.toml: not valid TOML: nested too deep"),
    ],
)
def test_what_is_no_gains_file_is_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "gains.toml"
    path.write_text(text)
    with pytest.raises(VftError, match=words):
        load_gains(path)


def test_a_robot_file_s_gains_are_checked_like_a_gains_file_s(tmp_path: Path) -> None:
    text = PROFILES["ur5"].read_text(encoding="utf-8")
    path = tmp_path / "arm.toml"
    path.write_text(text.replace("[observers.gmo]", "[observers.gmoo]"), encoding="utf-8")
    with pytest.raises(ParameterError, match=r"arm.toml: no observer 'gmoo'.* Did you mean gmo"):
        ObserverChoice().build(load_robot(path), 0.008)


def test_the_upper_layer_wins_parameter_by_parameter() -> None:
    under = {"kfo": {"r_diag": 1.0, "q_p_diag": 2.0}, "fdo": {"omega": 3.0}}
    over = {"kfo": {"r_diag": 9.0}, "gmo": {"gain": 4.0}}
    assert overlay_gains(under, over) == {
        "kfo": {"r_diag": 9.0, "q_p_diag": 2.0},
        "fdo": {"omega": 3.0},
        "gmo": {"gain": 4.0},
    }
    assert under["kfo"]["r_diag"] == 1.0  # the robot's own is left alone


def test_a_word_that_is_no_file_of_gains_says_which_words_there_are(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="--gains takes auto, paper, or a file"):
        load_gains(tmp_path / "papper")


def test_gains_come_from_a_pipe_too() -> None:
    read, write = os.pipe()
    os.write(write, b"[observers.gmo]\ngain = 12.0\n")
    os.close(write)
    try:
        assert load_gains(Path(f"/dev/fd/{read}")) == {"gmo": {"gain": 12.0}}
    finally:
        os.close(read)
