"""Forces of an episode: what is asked, what is refused, which frames they belong to."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.batch.annotation import ForceChoice, by_row, check_signals, force_columns
from vftcli.observers import ObserverChoice
from vftcli.readers.reader import ALL, ReadChoice
from vftcli.readers.reading import read, read_chosen
from vftcli.signals.errors import LogError, ParameterError
from vftcli.signals.recording import Recording
from vftcli.wrench import WrenchChoice, ZeroChoice

T = np.arange(40) / 25
Q = 0.3 * np.sin(T)[:, None] * np.ones(6)
LOG = Recording(t=T, q=Q, dq=Q, torque=Q + 1.0)


def test_one_observer_over_whole_episodes() -> None:
    with pytest.raises(ParameterError, match="the torques of one observer"):
        ForceChoice(observers=ObserverChoice(names=("gmo", "fdo")))
    for part in (ReadChoice(episode=1), ReadChoice(interval=(0, 1)), ReadChoice(episode=ALL)):
        with pytest.raises(ParameterError, match="every frame of every episode"):
            ForceChoice(read=part)
    usual = ForceChoice()
    assert (usual.observer, usual.is_online, usual.read.derive) == ("kfo-zoh", True, "none")
    assert usual.observers.from_rest


@pytest.mark.parametrize(
    "asked",
    [
        ForceChoice(observers=ObserverChoice(names=("gmo",), gains="auto")),
        ForceChoice(wrench=WrenchChoice(solver="smoother")),
        ForceChoice(wrench=WrenchChoice(zero=ZeroChoice(start=True))),
    ],
)
def test_what_looks_ahead_is_not_causal(asked: ForceChoice) -> None:
    columns = force_columns(asked, ["a"], derived=False, valid=True)
    assert not any(column.about["causal"] for column in columns)


def test_the_columns_and_what_they_say_of_themselves() -> None:
    asked = ForceChoice(wrench=WrenchChoice(frame="base"), sd=True, contacts=True)
    found = force_columns(asked, ["j1", "j2"], derived=False, valid=True)
    assert [(c.name, c.width) for c in found] == [
        ("external_torque", 2), ("external_torque_sd", 2), ("external_torque_valid", 1),
        ("wrench", 6), ("wrench_valid", 1), ("contact", 1),
    ]  # fmt: skip
    assert found[0].elements == ("j1.external_torque", "j2.external_torque")
    assert found[3].elements == ("fx", "fy", "fz", "mx", "my", "mz")
    assert found[3].about["frame"] == "base axes, moment about the flange point"
    # the list of contacts sees the complete episode
    assert [c.about["causal"] for c in found] == [True] * 5 + [False]
    derived = force_columns(asked, ["j1", "j2"], derived=True, valid=False)
    assert (len(derived), derived[0].about["causal"]) == (4, False)
    left = replace(asked, read=ReadChoice(arm="left"))
    (torque, *_) = force_columns(left, ["j"], derived=False, valid=False)
    assert torque.name == "external_torque_left"


def test_an_effort_that_was_not_measured_on_half_of_the_joints_is_refused() -> None:
    constant = LOG.torque.copy()  # type: ignore[union-attr]
    constant[:, :2] = 3.5
    check_signals(replace(LOG, torque=constant), anyway=False)
    constant[:, 2] = 0.0
    with pytest.raises(LogError, match=r"the effort of J1, J2, J3 is 3\.5 in every frame"):
        check_signals(replace(LOG, torque=constant), anyway=False)
    check_signals(replace(LOG, torque=constant), anyway=True)


def test_a_row_that_repeats_a_sample_has_its_value_and_one_that_is_none_has_none() -> None:
    values = np.array([[1.0], [2.0]])
    found = by_row(values, np.array([0, 0, -1, 1]))
    np.testing.assert_array_equal(found, np.float32([[1], [1], [np.nan], [2]]))
    assert by_row(values, None).dtype == np.float32


def test_the_samples_of_rows_come_from_the_reader(tmp_path: Path) -> None:
    """Rows 2 and 5 of 8 hold no number, row 7 repeats the stamp of row 6 (from 0)."""
    q = np.linspace(0, 0.1, 8)
    t = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.6]
    rows = [f"{t[k]},{'nan' if k in {2, 5} else q[k]},{q[k]}" for k in range(8)]
    path = tmp_path / "log.csv"
    path.write_text("t,q_1,q_2\n" + "\n".join(rows) + "\n")
    with pytest.raises(LogError, match="is nan in sample 3"):
        read(path)
    found = read_chosen(path, ReadChoice(skips_unknown=True))
    assert (found.samples, found.source.rows, found.source.duplicates) == (5, 8, 1)
    assert found.source.row_samples is not None
    assert found.source.row_samples.tolist() == [0, 1, -1, 2, 3, -1, 4, 4]
    assert "rows-unknown" in {remark.code for remark in found.source.remarks}
