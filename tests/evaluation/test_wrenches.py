"""Rows of wrenches: axes, units, bands, and contacts below them."""

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation.references import evaluate_wrenches, with_contacts
from vftcli.signals.wrench import AXES, Wrench
from vftcli.wrench.detection import ContactScore, Detection

T = 0.01 * np.arange(200)
WAVE = np.column_stack([np.sin((k + 1) * T) for k in range(6)])


def wrench(values: np.ndarray, name: str = "gmo", **more: object) -> Wrench:
    return Wrench(name=name, t=T, values=values, frame="base", **more)  # type: ignore[arg-type]


def rows(found: Wrench, reference: Wrench) -> dict[str, dict[str, object]]:
    table = evaluate_wrenches("log", [found], reference)
    return {row["axis"]: row for row in table.iter_rows(named=True)}


def test_an_axis_has_its_own_unit() -> None:
    """Errors 1 to 6: newtons for the first three, newton metres for the others."""
    found = rows(wrench(WAVE + np.arange(1.0, 7.0)), wrench(WAVE, "sensor"))
    assert list(found) == list(AXES)
    for k, axis in enumerate(AXES):
        here, there = ("N", "Nm") if axis.startswith("f") else ("Nm", "N")
        for size in ("rmse", "bias", "max"):
            assert found[axis][f"{size}_{here}"] == pytest.approx(k + 1.0)
        assert found[axis][f"rmse_{there}"] is None
        assert found[axis]["samples"] == len(T)
        assert found[axis]["correlation"] == pytest.approx(1.0)


@pytest.mark.parametrize(("error", "share"), [(0.0, 1.0), (0.97, 1.0), (0.99, 0.0), (3.0, 0.0)])
def test_the_band_holds_1_96_deviations(error: float, share: float) -> None:
    found = rows(wrench(WAVE + error, sd=np.full((200, 6), 0.5)), wrench(WAVE, "sensor"))
    assert {row["band_share"] for row in found.values()} == {share}


def test_a_sample_without_an_answer_is_zero_and_in_no_band() -> None:
    """A quarter without an answer, three eighths outside: three eighths are left within."""
    values = WAVE.copy()
    values[:50] = np.nan
    values[50:125] += 9.0
    found = rows(wrench(values, sd=np.ones((200, 6))), wrench(WAVE, "sensor"))
    assert found["mz"]["band_share"] == pytest.approx(0.375)
    assert found["mz"]["missing"] == pytest.approx(0.25)
    assert found["mz"]["samples"] == 200
    wanted = np.sqrt((np.sum(WAVE[:50, 5] ** 2) + 75 * 81.0) / 200)
    assert found["mz"]["rmse_Nm"] == pytest.approx(wanted)


def test_without_a_deviation_or_a_known_sample_there_is_no_share() -> None:
    assert rows(wrench(WAVE), wrench(WAVE, "sensor"))["fx"]["band_share"] is None
    nothing = wrench(np.full((200, 6), np.nan), sd=np.ones((200, 6)))
    row = rows(wrench(WAVE, sd=np.ones((200, 6))), nothing)["fx"]
    assert row["band_share"] is None
    assert row["rmse_N"] is None
    assert row["samples"] == 0


def test_contacts_stand_below_the_errors() -> None:
    detection = Detection(
        contacts=3, listed=5, missed=1, false_alarms=2, false_alarms_per_h=7.5,
        delay=(0.1, 0.3, np.nan),
    )  # fmt: skip
    score = ContactScore(name="gmo", signal="torque", detection=detection)
    errors = pl.DataFrame({"recording": ["log"], "observer": ["gmo"]})
    row = with_contacts(errors, "log", "truth", [score]).row(1, named=True)
    names = ("contacts", "listed_contacts", "found_contacts", "missed_contacts", "false_alarms")
    assert [row[name] for name in names] == [3, 5, 2, 1, 2]
    assert row["false_alarms_per_h"] == 7.5
    assert row["detection_delay_s"] == pytest.approx(0.2)  # the mean of those that were found
    assert row["longest_delay_s"] == pytest.approx(0.3)
