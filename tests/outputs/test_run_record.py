import json
from dataclasses import replace

import numpy as np
import pytest

import vftcli
from vftcli.analysis import Analysis
from vftcli.outputs.run_record import all_remarks, jsonable, run_record, to_json
from vftcli.signals import remarks
from vftcli.signals.remarks import Where, caution, fact


def test_run_json_says_how_to_make_it_again(analysis: Analysis) -> None:
    record = json.loads(to_json(analysis.run))
    assert record["command"].startswith("vftcli report '<script>")
    assert record["versions"]["vftcli"] == vftcli.__version__
    assert record["versions"]["numpy"] == np.__version__
    assert record["input"]["sha256"] == "ab" * 32
    t, source = analysis.recording.t, record["input"]
    known = {"samples": 600, "joints": 6, "duplicates": 0, "start_s": t[0], "end_s": t[-1]}
    assert source.items() >= known.items()
    assert source["rate_hz"] == pytest.approx(1.0 / np.median(np.diff(t)))
    assert len(record["robot"]["sha256"]) == 64
    assert "ON the robot" in record["conventions"]["sign"]
    repairs, warnings = ([r["message"] for r in record[key]] for key in ("repairs", "warnings"))
    assert repairs == ["turned the sign of <b>one</b> (--columns)"]
    assert warnings == ["left out look & feel of /odd: it does not cover the joints' time"]
    assert record["reference"]["name"] == "vendor"
    assert (record["robot"]["name"], record["robot"]["file"]) == ("ur5", None)  # built in
    found = {o["name"]: o for o in record["observers"]}
    assert list(found) == ["best", "fdo", "gmo", "kfo-fe", "kfo-zoh"]
    assert found["gmo"]["parameters"]["gain"] == [5.0, 3.0, 4.0, 10.0, 10.0, 10.0]
    assert found["fdo"]["zeta"] == [None] * 6
    keys = ("omega_n_rad_s", "delay_s", "bandwidth_hz")
    assert {len(observer[key]) for observer in found.values() for key in keys} == {6}


def test_lists_stand_on_one_line_and_what_is_not_finite_becomes_null() -> None:
    value = {"a": np.array([1.0, np.nan]), "b": float("inf"), "c": (np.float64(2.0), True, "x")}
    assert jsonable(value) == {"a": [1.0, None], "b": None, "c": [2.0, True, "x"]}
    record = {"gain": [1.0, None, 3.0], "words": ["a [", "] b"]}
    text = to_json(record)
    assert '"gain": [ 1.0, null, 3.0 ]' in text
    assert json.loads(text) == record


@pytest.fixture
def catalogue(monkeypatch: pytest.MonkeyPatch) -> None:
    """The catalogue with one remark more."""
    words = '[test-shift]\nshort = "shifted by {shift_s:.2f} s"\nlong = "it was shifted"\n'
    own = remarks.catalogue()
    monkeypatch.setattr(remarks, "catalogue", lambda: (words, *own))


@pytest.mark.usefixtures("catalogue")
def test_a_remark_is_recorded_as_data(analysis: Analysis) -> None:
    shift = caution("test-shift", Where("gmo", (2, 3), (1.0, 2.5)), shift_s=np.float64(0.25))
    record = json.loads(to_json(run_record(replace(analysis, remarks=(shift,)), "x")))
    assert record["remarks"][0] == {
        "code": "test-shift", "level": "caution", "message": "gmo: shifted by 0.25 s",
        "values": {"shift_s": 0.25}, "about": "gmo", "joints": [2, 3], "span_s": [1.0, 2.5],
    }  # fmt: skip


@pytest.mark.usefixtures("catalogue")
def test_a_remark_of_an_estimate_says_whose_it_is_once(analysis: Analysis) -> None:
    own = fact("test-shift", shift_s=0.25)
    first, *others = analysis.estimates
    noted = replace(analysis, estimates=(replace(first, remarks=(own, own)), *others), remarks=())
    found = all_remarks(noted)
    assert [str(remark) for remark in found].count("best: shifted by 0.25 s") == 1
    of_run = replace(noted, remarks=(own,))
    assert "best: shifted by 0.25 s" not in map(str, all_remarks(of_run))
    elsewhere = fact("test-shift", Where("sensor"), shift_s=0.25)
    of_another = replace(noted, estimates=(replace(first, remarks=(elsewhere,)),))
    assert elsewhere in all_remarks(of_another)
