"""What is shown of an examination: one line, a record, and what heads outputs that mean nothing."""

import json
from dataclasses import replace

import numpy as np
import pytest

from vftcli.doctor import Examination
from vftcli.doctor.fit import RobotMatch
from vftcli.outputs.examination import (
    examination_record,
    examination_text,
    health_line,
    health_record,
    overridden_lines,
)
from vftcli.outputs.page.shell import part
from vftcli.outputs.run_record import to_json
from vftcli.signals.recording import Recording, Source
from vftcli.signals.remarks import Remark, fact, warning
from vftcli.signals.wrench import WrenchFrame

LOG = Recording(t=np.arange(4.0), q=np.zeros((4, 6)), source=Source(label="a.csv"))
SLOW = warning("slow-rate", rate_Hz=10.0)
NONE = warning("no-velocity")
WRONG = warning("milliamperes", typical_A=5000.0)


def examination(*findings: Remark, read: tuple[Remark, ...] = ()) -> Examination:
    log = replace(LOG, source=replace(LOG.source, remarks=read))
    return Examination(recording=log, findings=findings, robots=())


def test_the_line_counts_warnings_and_says_the_first_whole() -> None:
    assert health_line(examination()) == "log health: sound"
    assert health_line(examination(fact("short", duration_s=1.0))) == "log health: sound"
    one = health_line(examination(SLOW))
    assert one.startswith("log health: 1 warning: slow-rate: 10 samples a second; vftcli inspect")
    three = health_line(examination(SLOW, NONE, NONE), named=True)
    assert three.startswith("a.csv: log health: 3 warnings: slow-rate: ")
    assert "; also no-velocity; vftcli" in three


def test_a_reader_s_warning_is_one_of_the_log() -> None:
    """It has no consequence and no remedy of its own in the catalogue: its words are enough."""
    cut = warning("effort-used", effort="a", kind="b", factor=1.0)
    line = health_line(examination(NONE, read=(cut, fact("short", duration_s=1.0))))
    assert line.startswith("log health: 2 warnings: effort-used: the a of the log")


def test_how_arms_miss_an_effort_that_is_misread_is_not_said_before_what_it_is() -> None:
    miss = RobotMatch(robot="ur10e", misfit=0.624, fits=False, evidence="effort", load=0.0)
    found = [replace(examination(f), robots=(miss,)) for f in (SLOW, WRONG)]
    slow, wrong = map(examination_text, found)
    assert "fit       ur10e (model error 62 %, by effort): does not fit" in slow
    assert "does not fit" not in wrong
    held = examination_text(replace(found[1], robots=(miss._replace(fits=True),)))
    assert "fit       --robot ur10e (model error 62 %, by effort)" in held


def test_the_record_is_strict_json_with_codes_and_values() -> None:
    odd = warning("slow-rate", rate_Hz=float("inf"))
    (record,) = json.loads(to_json(health_record([examination(odd, WRONG)])))
    assert (record["log"], record["sound"]) == ("a.csv", False)
    assert record["overridden"] == ["milliamperes"]
    assert [f["code"] for f in record["findings"]] == ["slow-rate", "milliamperes"]
    assert record["findings"][0]["values"] == {"rate_Hz": None}
    whole = json.loads(to_json(examination_record(examination(odd))))
    assert whole["findings"][0]["values"] == {"rate_Hz": None}


def test_only_what_refuses_heads_an_output_and_another_arm_not_what_identify_makes() -> None:
    assert overridden_lines([examination(SLOW)]) == []
    (line,) = overridden_lines([examination(SLOW, WRONG)])
    assert line.startswith("MEANINGLESS")
    assert "milliamperes" in line
    misfit = {"robot": "ur10e", "misfit_percent": 50.0, "ranked": "ur5 50 %"}
    other = examination(warning("no-robot-fits", **misfit))
    assert health_record([other])[0]["overridden"] == ["no-robot-fits"]
    assert health_record([other], fitting=False)[0]["overridden"] == []


@pytest.mark.parametrize("sound", [True, False])
def test_the_page_shows_warnings_first_and_escapes_names(sound: bool) -> None:
    note = fact("short", duration_s=1.0)
    made = examination(*([] if sound else [WRONG]), note)
    made = replace(made, recording=replace(LOG, source=Source(label="<b>.csv")))
    page = part("parts/alarms", [made, made]) + part("parts/health", [made, made], opened=True)
    assert "<b>.csv" not in page
    assert "&lt;b&gt;.csv" in page
    warnings_shown, notes = page.split("<strong>short</strong>", 1)
    assert ("milliamperes" in warnings_shown) == (not sound)
    assert (" open>" in page) == (not sound)
    assert notes.count("<strong>short</strong>") == 1  # the second log's
    assert page.startswith('<p class="alarm">MEANINGLESS') == (not sound)
    assert part("parts/health", []) == ""


def test_a_log_is_told_with_what_it_holds() -> None:
    """Four samples a second apart, of nine rows."""
    source = replace(LOG.source, rows=9, t0=12.5, clock="stamps")
    frame = WrenchFrame("base", "flange")
    held = replace(
        LOG, source=source, wrench=np.ones((4, 6)), wrench_frame=frame, payload_mass=0.73456,
        joint_names=tuple("abcdef"),
    )  # fmt: skip
    assert examination_text(replace(examination(), recording=held)).splitlines() == [
        "None: memory",
        "  joints    6 (a, b, c, d, e, f)",
        "  samples   4 of 9 rows, 3.000 s, 1 Hz, longest step 1000 ms",
        "  clock     stamps; first stamp 12.500000 s",
        "  signals   q, wrench",
        f"  wrench    {frame}",
        "  payload   0.735 kg, as the controller assumes",
        "  robot     not named in the log",
        "",
        "nothing suspicious found",
    ]
    assert "nothing suspicious" not in examination_text(examination(SLOW))
