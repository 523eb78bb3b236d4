"""Words of the command line: spans, lists of numbers, assignments."""

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vftcli.robots.robot_file import NUMBER, PER_JOINT, SWITCH, TEXT, WHOLE, vector
from vftcli.signals.arrays import one_each
from vftcli.signals.errors import ParameterError
from vftcli.signals.option import (
    Choice,
    Option,
    assignment,
    interval,
    interval_text,
    is_yes,
    numbers,
    set_value,
    settings_as_typed,
    settings_by_name,
)
from vftcli.signals.parsing import (
    check_kind,
    check_known,
    did_you_mean,
    printable,
    toml_tables,
    whole,
)


@pytest.mark.parametrize(
    ("text", "span"),
    [
        ("1:2", (1.0, 2.0)),
        (":2", (-np.inf, 2.0)),
        ("1:", (1.0, np.inf)),
        (":", (-np.inf, np.inf)),
    ],
)
def test_intervals(text: str, span: tuple[float, float]) -> None:
    assert interval(text) == span


@pytest.mark.parametrize("text", ["2", "2:1", "a:b", "1:1", "1:b", "1:2:3"])
def test_intervals_that_are_none(text: str) -> None:
    with pytest.raises(ParameterError, match="A:B with A < B"):
        interval(text)


@pytest.mark.parametrize("text", ["1.5:3", ":3", "2:", ":"])
def test_a_span_is_said_as_it_is_typed(text: str) -> None:
    """An open end was "-inf"."""
    assert interval_text(*interval(text)) == text


def test_an_endless_line_of_toml_is_refused_before_it_is_parsed() -> None:
    """50 000 dots took 15 s; so many letters in lines of their own are fine."""
    with pytest.raises(
        ParameterError, match="line 2 has 50001 letters; a line of TOML has at mos"
    ):
        toml_tables(f"a = 1\n{'.' * 50_000}a")
    assert len(toml_tables("".join(f"a{k} = 1\n" for k in range(2_000)))) == 2_000


def test_numbers_or_none() -> None:
    assert numbers("1,-2.5, 3e-1") == (1.0, -2.5, 0.3)
    assert numbers("1,,2") is None
    assert numbers("tool") is None


def test_assignments() -> None:
    assert assignment(" gmo.gain = 5,3 ", "--set", "KEY=VALUE") == ("gmo.gain", "5,3")
    assert assignment("a=b=c", "--set", "KEY=VALUE") == ("a", "b=c")


@pytest.mark.parametrize("text", ["gain", "gain=", "=3", " = ", ""])
def test_assignments_that_are_none(text: str) -> None:
    with pytest.raises(ParameterError, match=r"--set .* is not KEY=VALUE"):
        assignment(text, "--set", "KEY=VALUE")


def test_only_a_name_that_is_near_is_asked_for() -> None:
    assert did_you_mean("gian", ("gain", "omega")) == " Did you mean gain?"
    assert did_you_mean("speed", ("gain", "omega")) == ""


def test_an_unknown_word_is_refused_with_what_there_is() -> None:
    check_known("fe", {"fe": 1, "zoh": 2}, "unheard")
    with pytest.raises(ParameterError, match=r"^discretisation 'rk4'; there is fe, zoh$"):
        check_known("rk4", {"fe": 1, "zoh": 2}, "discretisation 'rk4'")


def test_a_thing_of_another_kind_is_refused_with_what_gives_one() -> None:
    check_kind(True, int, "the count", "len(x)")  # a subclass is of the kind
    with pytest.raises(
        ParameterError, match=r"^the count is 'a'; expected int: len\(x\) is one$"
    ):
        check_kind("a", int, "the count", "len(x)")
    with pytest.raises(ParameterError, match=r"^the count is ndarray; expected int"):
        check_kind(np.zeros(3), int, "the count", "len(x)")


ANY_TEXT = st.text(st.characters(codec=None, exclude_categories=[]))
"""All that a Python text can hold, halves of letters too."""


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("log.csv", "log.csv"),
        ("ログ é 10 N·m – «x»", "ログ é 10 N·m – «x»"),
        ("bad\udcff.csv", r"bad\xff.csv"),
        ("half\ud800", r"half\ud800"),
        ("red\x1b[31m", r"red\x1b[31m"),
        ("two\nlines\r\t", r"two\nlines\r\t"),
        ("turned\u202etxt", r"turned\u202etxt"),
        ("end\u2028", r"end\u2028"),
    ],
)
def test_what_is_hidden_is_spelled(name: str, shown: str) -> None:
    assert printable(name) == shown


@given(ANY_TEXT)
def test_every_text_is_printable_and_fits_utf_8(text: str) -> None:
    shown = printable(text)
    shown.encode("utf-8")
    assert len(shown.splitlines()) <= 1
    assert printable(shown) == shown
    assert json.loads(json.dumps(whole(text), ensure_ascii=False).encode()) == whole(text)


FLOATS = st.floats(allow_nan=False, allow_infinity=False)
VALUES = st.one_of(
    st.booleans(), st.integers(), st.floats(), st.text(), st.lists(FLOATS, max_size=3)
)


@pytest.mark.slow  # the first text of a process: Hypothesis lists the letters of Unicode
@given(value=VALUES)
def test_a_plain_value_is_of_its_own_kind_alone(value: object) -> None:
    """Of these kinds only whole numbers are of two, and true is no number."""
    kinds = {NUMBER: (int, float), WHOLE: (int,), SWITCH: (bool,), TEXT: (str,)}
    for kind, types in kinds.items():
        fits = type(value) in types and (not isinstance(value, float) or bool(np.isfinite(value)))
        assert (kind.broken("key", value) == "") == fits


@given(numbers=st.lists(FLOATS, min_size=1, max_size=4), count=st.integers(1, 4))
def test_a_list_is_spread_where_it_has_one_or_one_for_each(
    numbers: list[float], count: int
) -> None:
    assert PER_JOINT.broken("key", numbers) == ""
    assert (vector(count).broken("key", numbers) == "") == (len(numbers) == count)
    text = ",".join(map(repr, numbers))
    assert one_each(set_value(text, text), len(numbers), "key").tolist() == numbers
    if len(numbers) not in {1, count}:
        with pytest.raises(ParameterError, match=f"give one, or one for each of {count} joints"):
            one_each(numbers, count, "key")


def test_an_integer_beyond_every_float_is_no_number() -> None:
    assert NUMBER.broken("mass", 10**400).endswith("it must be a finite number")
    assert PER_JOINT.broken("gain", []) == "gain is []; it must be a number or one a joint"


RATE = Option("a.rate", "HZ", "How fast.", least=2.0)
DETAILS = Option("-v/--details", "", "All of it.")
FORM = Option("--form-of-it", "svg|PDF|png", "Its form.", reads=str.upper)
NAMES = Option("--name", "NAME", "A name.", several=True, completes=lambda: ("one", "two"))


def test_an_option_has_a_word_a_name_in_complaints_and_values() -> None:
    options = (RATE, DETAILS, FORM, NAMES)
    assert [option.word for option in options] == ["a.rate", "details", "form_of_it", "name"]
    assert [option.typed for option in options] == [
        "a.rate",
        "--details",
        "--form-of-it",
        "--name",
    ]
    assert [option.is_setting for option in options] == [True, False, False, False]
    assert [option.values() for option in options] == [[], [], ["svg", "png"], ["one", "two"]]
    assert (FORM.read("svg"), FORM.read(None), NAMES.read(("a",))) == ("SVG", None, ("a",))
    assert not Option("", "FILE", "An argument.").is_setting


@pytest.mark.parametrize(
    ("option", "value", "typed"),
    [
        (RATE, 2.5, "2.5"),
        (RATE, "2.5", "2.5"),
        (RATE, None, None),
        (RATE, True, "yes"),
        (RATE, False, "no"),
        (RATE, (1, 2.0), "1,2.0"),
        (DETAILS, True, True),
        (DETAILS, False, False),
        (NAMES, "one", ["one"]),
        (NAMES, ("one", "two"), ["one", "two"]),
        (FORM, Path("a"), "a"),
        (DETAILS, 1, r"details is 1; expected True or False"),
        (RATE, [], r"a.rate is \[\]; expected a text or a number"),
        (RATE, [True, 1], r"a.rate is \[True, 1\]; expected"),
        (NAMES, [{}], r"name is {}; expected"),
    ],
)
def test_a_keyword_is_as_it_would_be_typed(option: Option, value: object, typed: object) -> None:
    if isinstance(typed, str) and "expected" in typed:
        with pytest.raises(ParameterError, match=typed):
            option.keyword(value)
    else:
        assert option.keyword(value) == typed


@pytest.mark.parametrize(
    ("text", "kind", "value"),
    [
        ("2", int, 2),
        ("2.0", float, 2.0),
        ("1.9", float, "--set a.rate=1.9 is not a number of 2 or more"),
        ("2.5", int, "is not a whole number of 2 or more"),
        ("fast", float, "is not a number of 2 or more"),
    ],
)
def test_a_setting_s_number_is_in_its_range(text: str, kind: type, value: object) -> None:
    if isinstance(value, str):
        with pytest.raises(ParameterError, match=value):
            RATE.number(text, kind)
    else:
        assert RATE.number(text, kind) == value
    with pytest.raises(ParameterError, match=r"is not a number$"):
        RATE._replace(least=None).number("fast", float)
    assert RATE._replace(least=None).number("-5", float) == -5.0


class Chosen(Choice):
    """Two settings, an option that may be repeated, and numbers with names of their own."""

    rate: Annotated[float | None, RATE] = None
    count: Annotated[int, Option("b.count", "N", "How many.")] = 3
    names: Annotated[tuple[str, ...], NAMES] = ()
    numbers: Annotated[tuple[str, ...], Option("numbers", "N", "Any.", several=True)] = ()


@pytest.mark.parametrize(
    ("words", "settings", "chosen"),
    [
        ({}, {}, Chosen()),
        ({"name": []}, {}, Chosen()),
        ({"name": ["one"]}, {"a.rate": "4"}, Chosen(rate=4.0, names=("one",))),
        ({}, {"b.count": "5", "other.room": "1"}, Chosen(count=5)),
        ({"a.rate": 7.0}, {}, Chosen(rate=7.0)),
        ({"name": None}, {"b.count": "5"}, Chosen(count=5)),
    ],
)
def test_words_and_settings_make_a_choice(
    words: dict[str, object], settings: dict[str, str], chosen: Chosen
) -> None:
    assert Chosen.parsed(settings=settings, **words) == chosen


def test_settings_are_named_with_their_defaults() -> None:
    found = settings_by_name([Chosen])
    assert {name: default for name, (_, default) in found.items()} == {
        "a.rate": None, "b.count": 3, "numbers": (),
    }  # fmt: skip
    assert not Chosen.takes("numbers")
    assert settings_as_typed({"b.count": 5}, [Chosen]) == {"b.count": "5"}
    with pytest.raises(ParameterError, match=r"--set a.rat is no setting here; .* mean a.rate\?"):
        settings_as_typed({"a.rat": 5}, [Chosen], "--set ")
    assert (is_yes("yes"), is_yes("no")) == (True, False)
    with pytest.raises(ParameterError, match="'maybe' is neither yes nor no"):
        is_yes("maybe")
