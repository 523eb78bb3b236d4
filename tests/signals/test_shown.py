"""What a notebook shows: one line, a small table, a frame; never an array of thousands."""

from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import polars as pl
import pytest

from vftcli.robots import load_robot
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording, Source
from vftcli.signals.remarks import Remark, Remarks, caution, fact
from vftcli.signals.shown import LONGEST, Shown, frame_of
from vftcli.signals.wrench import AXES, Wrench

T = np.linspace(0.0, 1.0, 501)
Q = np.outer(T, np.arange(1.0, 7.0))


@dataclass(frozen=True, repr=False)
class Thing(Shown):
    name: str = "a\nb <i>"
    few: np.ndarray | None = None
    many: np.ndarray | None = None
    words: tuple[str, ...] = ()


def things() -> list[Shown]:
    recording = Recording(t=T, q=Q, wrench=Q, source=Source(path=Path("log.csv")))
    tau = np.where(Q > 5.5, np.nan, Q)
    torque = ExternalTorque(name="gmo", t=T, tau=tau, error_sd=np.ones_like(Q))
    wrench = Wrench(name="best", t=T, values=Q, sd=Q, frame="base", masked=T > 0.5)
    return [Thing(few=T[:3], many=Q, words=("x", "y")), recording, recording.source, torque,
            wrench, Remarks([fact("as-printed")]), fact("as-printed")]  # fmt: skip


@pytest.mark.parametrize("thing", things(), ids=lambda thing: type(thing).__name__)
def test_a_thing_is_one_short_line_and_a_whole_table(thing: Shown) -> None:
    line = repr(thing)
    assert line.startswith(f"<{type(thing).__name__}")
    assert len(line) <= LONGEST + 2  # its angle brackets
    assert "\n" not in line
    assert ET.fromstring(thing._repr_html_()).tag == "table"


def test_fields_are_numbers_or_shapes_and_their_letters_are_escaped() -> None:
    thing = Thing(few=np.array([1.5, np.nan]), many=Q)
    assert repr(thing) == "<Thing name a\\nb <i>, few [1.5 –], many array (501, 6)>"
    assert "&lt;i&gt;" in thing._repr_html_()


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (np.arange(7.0), "[0 1 2 3 4 5 6]"),
        (np.arange(8.0), "array (8,)"),
        (np.zeros((2, 3)), "array (2, 3)"),
        (tuple("abcdefg"), "a b c d e f g"),
        (tuple("abcdefgh"), "8 × str"),
        ({"a": 1, "b": 2}, "a b"),
        ([Path("a"), Path("b")], f"2 × {type(Path()).__name__}"),
        (Path("a/b"), str(Path("a/b"))),
        (12345.678, "1.235e+04"),
        (3, "3"),
        (float("nan"), "–"),
        (T.mean, "builtin_function_or_method"),
        *((nothing, "") for nothing in (None, "", (), [], {})),
    ],
)
def test_a_field_is_a_few_letters_or_left_out(value: object, text: str) -> None:
    words = f", words {text}" if text else ""
    assert repr(Thing(words=value)) == f"<Thing name a\\nb <i>{words}>"  # type: ignore[arg-type]


def test_a_long_line_is_cut() -> None:
    whole = "x" * (LONGEST - len("Thing name "))
    assert repr(Thing(name=whole)) == f"<Thing name {whole}>"
    assert repr(Thing(name=whole + "x")) == f"<Thing name {whole[:-1]}…>"


def test_frames_have_the_columns_of_the_files_and_null_for_what_is_not_known() -> None:
    _, recording, _, torque, wrench, *_ = things()
    wanted = ["t", *(f"q/{j}" for j in range(1, 7)), *(f"wrench/{axis}" for axis in AXES)]
    assert recording.to_polars().columns == wanted
    assert recording.to_polars()["q/3"].to_list() == Q[:, 2].tolist()
    frame = torque.to_polars()
    assert frame.columns[1] == "tau_ext/gmo/1"
    assert frame.columns[-1] == "band/gmo/6"
    assert frame["tau_ext/gmo/6"].null_count() == np.count_nonzero(Q[:, 5] > 5.5)
    assert wrench.to_polars()["wrench/best/fx"].null_count() == np.count_nonzero(T > 0.5)


def test_a_robot_is_a_frame_of_its_joints() -> None:
    """The profile's numbers; an arm without drive constants has the same columns."""
    robot = load_robot("ur5")
    frame = robot.to_polars()
    assert frame["joint"].to_list()[:2] == ["J1 shoulder_pan", "J2 shoulder_lift"]
    assert frame["mass_kg"].to_list() == robot.chain.mass.tolist()
    assert frame["torque_constant_Nm_A"].to_list() == [12.625] * 3 + [9.3122] * 3
    bare = replace(robot, torque_constant=None, friction=()).to_polars()
    assert bare.schema == frame.schema
    assert bare["torque_constant_Nm_A"].null_count() == 6
    assert set(bare["friction"]) == {"none"}


def test_remarks_are_a_tuple_with_a_frame() -> None:
    first, second = fact("as-printed"), replace(caution("as-printed"), level="warning")
    remarks = Remarks([first, second])
    assert (*remarks, first) == (first, second, first)
    assert repr(remarks) == "<Remarks 1 fact, 1 warning>"
    assert repr(Remarks()) == "<Remarks none>"
    frame = remarks.to_polars()
    assert frame["level"].to_list() == ["fact", "warning"]
    assert frame["message"][0] == str(first)
    assert Remarks().to_polars().columns == frame.columns
    # A remark without words is shown too.
    assert repr(Remark("no-such-code")) == "<Remark fact no-such-code:>"


def test_a_frame_keeps_whole_numbers() -> None:
    frame = frame_of([("k", np.arange(3)), ("x", np.array([1.0, np.nan, 2.0]))])
    assert frame["k"].dtype == pl.Int64
    assert frame["x"].to_list() == [1.0, None, 2.0]
