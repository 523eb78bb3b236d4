"""Words of the command line: spans, lists of numbers, assignments."""

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vftcli.signals import parsing
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


@pytest.mark.parametrize(
    ("text", "span"), [("1.5:3", (1.5, 3.0)), (":3", (-np.inf, 3.0)), ("2:", (2.0, np.inf))]
)
def test_intervals_are_read_and_said_as_they_are_typed(text: str, span: tuple) -> None:
    """An open end was said as "-inf"."""
    assert interval(text) == span
    assert interval_text(*span) == text


@pytest.mark.parametrize("text", ["2", "2:1", "a:b", "1:1", "1:b", "1:2:3"])
def test_intervals_that_are_none(text: str) -> None:
    with pytest.raises(ParameterError, match="A:B with A < B"):
        interval(text)


def test_an_endless_line_of_toml_is_refused_before_it_is_parsed() -> None:
    """50 000 dots took 15 s; so many letters in lines of their own are fine."""
    with pytest.raises(ParameterError, match="line 2 has 50001 letters; a line of TOML has at"):
        parsing.toml_tables(f"a = 1\n{'.' * 50_000}a")
    assert len(parsing.toml_tables("".join(f"a{k} = 1\n" for k in range(2_000)))) == 2_000


def test_numbers_and_assignments() -> None:
    assert numbers("1,-2.5, 3e-1") == (1.0, -2.5, 0.3)
    assert numbers("1,,2") is None
    assert numbers("tool") is None
    assert assignment(" gmo.gain = 5,3 ", "--set", "KEY=VALUE") == ("gmo.gain", "5,3")
    assert assignment("a=b=c", "--set", "KEY=VALUE") == ("a", "b=c")


@pytest.mark.parametrize("text", ["gain", "gain=", "=3", " = ", ""])
def test_assignments_that_are_none(text: str) -> None:
    with pytest.raises(ParameterError, match=r"--set .* is not KEY=VALUE"):
        assignment(text, "--set", "KEY=VALUE")


def test_an_unknown_word_is_refused_with_what_there_is() -> None:
    assert parsing.did_you_mean("gian", ("gain", "omega")) == " Did you mean gain?"
    assert parsing.did_you_mean("speed", ("gain", "omega")) == ""
    parsing.check_known("fe", {"fe": 1, "zoh": 2}, "unheard")
    with pytest.raises(ParameterError, match=r"^discretisation 'rk4'; there is fe, zoh$"):
        parsing.check_known("rk4", {"fe": 1, "zoh": 2}, "discretisation 'rk4'")


@pytest.mark.parametrize(("thing", "shown"), [("a", "'a'"), (np.zeros(3), "ndarray")])
def test_a_thing_of_another_kind_is_refused_with_what_gives_one(thing, shown) -> None:
    parsing.check_kind(True, int, "the count", "len(x)")  # a subclass is of the kind
    words = rf"^the count is {shown}; expected int: len\(x\) is one$"
    with pytest.raises(ParameterError, match=words):
        parsing.check_kind(thing, int, "the count", "len(x)")


ANY_TEXT = st.text(st.characters(codec=None, exclude_categories=[]))
"""All that a Python text can hold, halves of letters too."""


@pytest.mark.parametrize(
    ("name", "shown"),
    [
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
    assert parsing.printable(name) == shown


@given(ANY_TEXT)
def test_every_text_is_printable_and_fits_utf_8(text: str) -> None:
    shown = parsing.printable(text)
    shown.encode("utf-8")
    assert len(shown.splitlines()) <= 1
    assert parsing.printable(shown) == shown
    kept = parsing.whole(text)
    assert json.loads(json.dumps(kept, ensure_ascii=False).encode()) == kept


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=4))
def test_a_list_is_spread_where_it_has_one_or_one_for_each(numbers: list[float]) -> None:
    text = ",".join(map(repr, numbers))
    assert one_each(set_value(text, text), len(numbers), "key").tolist() == numbers
    assert one_each(numbers[0], 6, "key").tolist() == numbers[:1] * 6
    if len(numbers) > 1:
        with pytest.raises(ParameterError, match="give one, or one for each of 6 joints"):
            one_each(numbers, 6, "key")


RATE = Option("a.rate", "HZ", "How fast.", least=2.0)
DETAILS = Option("-v/--details", "", "All of it.")
FORM = Option("--form-of-it", "svg|PDF|png", "Its form.", reads=str.upper)
NAMES = Option("--name", "NAME", "A name.", several=True, completes=lambda: ("one", "two"))


def test_an_option_has_a_word_a_name_in_complaints_and_values() -> None:
    found = {option.word: (option.typed, option.is_setting, option.values())
             for option in (RATE, DETAILS, FORM, NAMES)}  # fmt: skip
    assert found == {
        "a.rate": ("a.rate", True, []),
        "details": ("--details", False, []),
        "form_of_it": ("--form-of-it", False, ["svg", "png"]),
        "name": ("--name", False, ["one", "two"]),
    }
    assert (FORM.read("svg"), FORM.read(None), NAMES.read(("a",))) == ("SVG", None, ("a",))
    assert not Option("", "FILE", "An argument.").is_setting


@pytest.mark.parametrize(
    ("option", "value", "typed"),
    [
        (RATE, 2.5, "2.5"), (RATE, "2.5", "2.5"), (RATE, None, None), (RATE, True, "yes"),
        (RATE, False, "no"), (RATE, (1, 2.0), "1,2.0"), (DETAILS, True, True),
        (DETAILS, False, False), (NAMES, "one", ["one"]), (NAMES, ("one", "two"), ["one", "two"]),
        (FORM, Path("a"), "a"),
    ],
)  # fmt: skip
def test_a_keyword_is_as_it_would_be_typed(option: Option, value: object, typed: object) -> None:
    assert option.keyword(value) == typed


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        (DETAILS, 1, r"details is 1; expected True or False"),
        (RATE, [], r"a.rate is \[\]; expected a text or a number"),
        (RATE, [True, 1], r"a.rate is \[True, 1\]; expected"),
        (NAMES, [{}], r"name is {}; expected"),
    ],
)
def test_a_keyword_that_nobody_can_type_is_refused(option, value, words) -> None:
    with pytest.raises(ParameterError, match=words):
        option.keyword(value)


def test_a_setting_s_number_is_in_its_range() -> None:
    assert (RATE.number("2", int), RATE.number("2.0", float)) == (2, 2.0)
    free = RATE._replace(least=None)
    assert free.number("-5", float) == -5.0
    for option, text, kind, words in (
        (RATE, "1.9", float, "--set a.rate=1.9 is not a number of 2 or more"),
        (RATE, "2.5", int, "is not a whole number of 2 or more"),
        (RATE, "fast", float, "is not a number of 2 or more"),
        (free, "fast", float, "is not a number$"),
    ):
        with pytest.raises(ParameterError, match=words):
            option.number(text, kind)


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
        ({"name": ["one"]}, {"a.rate": "4"}, Chosen(rate=4.0, names=("one",))),
        ({}, {"b.count": "5", "other.room": "1"}, Chosen(count=5)),
        ({"a.rate": 7.0}, {}, Chosen(rate=7.0)),
        ({"name": None}, {"b.count": "5"}, Chosen(count=5)),
    ],
)
def test_words_and_settings_make_a_choice(words, settings, chosen):
    assert Chosen.parsed(settings=settings, **words) == chosen


def test_settings_are_named_with_their_defaults() -> None:
    found = settings_by_name([Chosen])
    defaults = {name: default for name, (_, default) in found.items()}
    assert defaults == {"a.rate": None, "b.count": 3, "numbers": ()}
    assert not Chosen.takes("numbers")
    assert settings_as_typed({"b.count": 5}, [Chosen]) == {"b.count": "5"}
    with pytest.raises(ParameterError, match=r"--set a.rat is no setting here; .* mean a.rate\?"):
        settings_as_typed({"a.rat": 5}, [Chosen], "--set ")
    assert (is_yes("yes"), is_yes("no")) == (True, False)
