"""What a benchmark says of rows with known sums: errors, lists and shifts that are made up."""

import re
from typing import Any

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation.scores import LAGS
from vftcli.outputs.benchmark import Results, arm_texts, list_texts, render_benchmark, text_of
from vftcli.reproduction.scoring import SCHEMA

COMMON = {
    "protocol": "online", "future": False, "exact_model": False, "marked": False,
    "truth_error_Nm": 0.3,
}  # fmt: skip
CELLS = np.full(10, 2.0)
"""Ten cells of 2 s, more than the eight that a bootstrap needs; all alike, so it has no width."""


def rows_of(
    log: str, arm: str, method: str, part: str, *, error: float, truth: float, **more: Any
) -> list[dict[str, Any]]:
    """Two joints with a constant error against a constant torque [N·m]; band of ±2 N·m."""
    share, shared = more.pop("missing", 0.0), COMMON | {"part": part} | more
    shared |= {"log": log, "arm": arm, "method": method}
    sums = {
        "seconds": CELLS, "missing": share * CELLS, "squares": error**2 * CELLS,
        "sizes": error * CELLS, "truth": truth**2 * CELLS, "banded": CELLS,
        "covered": (error <= 2.0) * CELLS,
        "penalties": (4.0 + 40.0 * max(error - 2.0, 0.0)) * CELLS,
    }  # fmt: skip
    shared |= {name: values.tolist() for name, values in sums.items()}
    return [shared | {"joint": joint, "rmse_Nm": error, "l1_Nm": error} for joint in (1, 2)]


def counted(log: str, arm: str, **counts: Any) -> dict[str, Any]:
    """A row of a list of contacts."""
    row = COMMON | {"log": log, "arm": arm, "method": "best", "part": "list", "future": True}
    values = {"split": 0, "found_as_load": 0, "peaks_held": 0, "onset_s": [], "peak_error_N": []}
    return row | values | {"true_peak_N": []} | counts


def made() -> Results:
    """Two arms; one joint observer lacks the second; a vendor is silent for a tenth of the time."""
    rows: list[dict[str, Any]] = []
    for arm, truth, best in (("UR5", 10.0, 2.0), ("Panda", 5.0, 0.5)):
        log = f"{arm}-log"
        for method, error in (("zero", truth), ("gmo", best + 0.2), ("best", best)):
            more = {"future": method == "best", "marked": arm == "Panda"}
            rows += rows_of(log, arm, method, "contact", error=error, truth=truth, **more)
            free = 0.0 if method == "zero" else 0.4 * error
            rows += rows_of(log, arm, method, "free", error=free, truth=0.0, **more)
            whole = rows_of(log, arm, method, "all", error=error, truth=truth, **more)
            rows += whole
            if method != "zero":
                # The least error, half of that at no shift, 30 ms later.
                squares = 1.0 + abs(LAGS - 0.03) / 0.01
                rows.append({**whole[0], "joint": None, "lag_squares": squares.tolist()})
    rows += rows_of("UR5-log", "UR5", "vendor", "contact", error=6.0, truth=10.0, missing=0.1)
    # Of an arm that is its own model no error says anything: it is in no mean.
    for method in ("zero", "best"):
        exact = {"error": 1.0, "truth": 4.0, "exact_model": True}
        rows += rows_of("sim", "Simulated", method, "contact", **exact)
    rows += [
        counted(
            "a", "UR5", true_contacts=10, found=9, false=2, free_h=0.1, onset_s=[0.1, 0.2, 0.6],
            peak_error_N=[3.0, -1.0], true_peak_N=[40.0, 60.0], peaks_held=1, hardest_false_N=12.4,
            split=1,
        ),
        counted("b", "UR5", true_contacts=5, found=5, false=0, free_h=0.4, onset_s=[0.3]),
        counted("c", "Panda", true_contacts=0, found=0, false=0, free_h=0.5),
    ]  # fmt: skip
    return Results(pl.DataFrame(rows, schema=SCHEMA))


SCREEN = """\
method  skill, online  L1, online [N·m]
zero             0.00                 0
gmo              0.82             0.580
best             0.85             0.500
best lists, online: 14 of 15 true contacts; 2 false, 2 per hour (95 %: 0 to 7)
in no mean, as some arm lacks them (-v and page have their rows): vendor
vendor, online: no answer for 10.0 % of the time, read as 0
skill: 1 exact, 0 as an estimate of zero; L1: mean |error| without contact
alone: built-in profile; free: and contact-free motion; identified: own file
skill, online, is the mean of UR5; Panda
L1 is the mean of UR5; Panda, where the protocol has them
uses the whole log, the future too: best
scored despite a complaint (--anyway): Panda-log
"""
"""Skill 1 − 2.2/10 and 1 − .7/5, 1 − 2/10 and 1 − .5/5; L1 .4 of 2.2 and .7, of 2 and .5."""


def test_the_headline_is_the_mean_over_arms_of_methods_that_have_all_of_them() -> None:
    assert text_of(made(), "terminal", every=False) == SCREEN


def test_every_row_has_its_errors_and_its_shift() -> None:
    rows = {(row["arm"], row["method"], row["part"]): row for row in made().rows}
    contact, free, whole = (rows["UR5", "gmo", part] for part in ("contact", "free", "all"))
    numbers = ("rmse_Nm", "rmse_low_Nm", "rmse_high_Nm", "over_best_low_Nm", "over_best_high_Nm")
    assert [contact[key] for key in numbers] == pytest.approx([2.2, 2.2, 2.2, 0.2, 0.2])
    # A band of ±2 N·m that misses by .2: its width of 4, and 40 times what it misses by.
    assert (contact["coverage_95"], contact["interval_score_Nm"]) == (0.0, pytest.approx(12.0))
    assert (contact["seconds"], contact["exact_model"], contact["missing"]) == (20.0, False, 0.0)
    best = rows["UR5", "best", "free"]
    assert np.isnan([free["skill"], free["lag_s"], best["over_best_low_Nm"]]).all()
    # 1 + 3 at no shift, 1 at 30 ms.
    assert (whole["lag_s"], whole["rmse_at_lag"]) == (pytest.approx(0.03), pytest.approx(0.5))


def test_a_difference_within_the_truth_s_own_error_is_marked() -> None:
    rows = [row for row in made().rows if (row["arm"], row["part"]) == ("UR5", "contact")]
    zero, gmo, best, vendor = arm_texts(rows)
    assert [row["rmse"].text + row["rmse"].mark for row in (zero, gmo, best, vendor)] == [
        "10.0", "2.20~", "2.00", "6.00",
    ]  # fmt: skip
    assert (gmo["interval"], gmo["over_best"], gmo["lag"]) == ("2.2–2.2", "+0.2 to +0.2", "–")
    assert best["over_best"] == "–"
    sure = [row | {"truth_error_Nm": 0.1} for row in rows]
    assert not arm_texts(sure)[1]["rmse"].mark
    rows = {(row["arm"], row["method"], row["part"]): row for row in made().rows}
    assert arm_texts([rows["UR5", "gmo", "all"]])[0]["lag"] == "+0.03 (× 0.50)"


def test_lists_are_pooled_by_arm() -> None:
    """95 % intervals: Wilson's of 14 of 15, Poisson's of 2 in .5 h, .5 to 14.4 an hour."""
    (lists,) = made().lists()
    ur5, panda = map(list_texts, lists.to_dicts())
    assert (ur5["share"], ur5["rate"]) == ("14/15 (0.70–0.99)", "4 (0–14)")
    # Of .1, .2, .3 and .6 s; of errors of 3 and −1 N.
    assert ur5["onset"] == "0.25 (0.51)"
    assert ur5["peaks"] == "+1.0, rms 2.2 of 50, 1 held"
    assert (ur5["hardest"], ur5["split"], ur5["rows"]) == (12.4, 1, "counted")
    assert [panda[key] for key in ("share", "onset", "peaks", "hardest")] == ["–", "–", "–", None]
    assert panda["rate"] == "0 (0–7)"


def test_every_arm_has_a_table() -> None:
    lines = text_of(made(), "terminal", every=True).splitlines()
    titles = [line for line in lines if " s)" in line]
    parts = ["contact", "free", "all"]
    arms = [f"{arm}, online, {part} (20 s)" for arm in ("UR5", "Panda") for part in parts]
    assert titles == [*arms, "Simulated, online, contact (20 s)"]


def test_dots_lie_at_their_skill_method_by_method() -> None:
    record = {"manifest": "m", "manifest_sha256": "0" * 64, "left_out": [], "failures": {}}
    page = render_benchmark(made(), "title", record | {"logs": []})
    (figure,) = re.findall("<title>Skill by arm, online</title>.*?</svg>", page, re.DOTALL)
    dot = r'<title>([^<]*?): ([-.\d]*)</title><path d="M(.*?) .*?H(.*?)".*?cx="(.*?)" cy="(.*?)"'
    dots = {name: [*map(float, places)] for name, *places in re.findall(dot, figure)}
    assert [name.partition(",")[0] for name in dots][::3] == ["UR5", "Panda"]
    # 384 of 400 pixels from −.05 to 1.05; 46 a row, of which the dots begin at .4.
    skills = {"UR5, gmo": 0.78, "UR5, best": 0.8, "UR5, vendor": 0.4, "Panda, gmo": 0.86}
    for name, skill in skills.items():
        x = 8.0 + 384.0 * (skill + 0.05) / 1.1
        assert dots[name][:4] == pytest.approx([skill, x, x, x], abs=0.06)
    rows = {"UR5, gmo": 0.4, "UR5, best": 0.4 + 0.55 / 3, "Panda, gmo": 1.4}
    for name, row in rows.items():
        assert dots[name][4] == pytest.approx(8.0 + 46.0 * row, abs=0.06)
    assert 'viewBox="0 0 400 164"' in page
