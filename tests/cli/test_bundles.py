"""Bundles: typer sees one parameter an option, the command one object a bundle."""

import inspect
from importlib import import_module
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from vftcli.cli import options as opt
from vftcli.cli.bundles import (
    REQUIRED,
    Bundle,
    ChoiceBundle,
    flag,
    option,
    parameters,
    taken_apart,
)


class Inner(Bundle):
    size: int = option("--size", "N", "How large.", 3)
    loud: bool = flag("--loud", "Whether loud.")


class Longer(Inner):
    word: str = option("--word", "W", "Which word.", REQUIRED)


class Outer(Bundle):
    inner: Inner
    longer: Longer


def called(*words: str) -> tuple[int, dict[str, object]]:
    """Run a command with bundles; return its exit code and what it was handed."""
    seen: dict[str, object] = {}

    @taken_apart
    def command(
        name: Annotated[str, typer.Argument()],
        inner: Inner,
        times: Annotated[int, typer.Option()] = 1,
    ) -> None:
        """Do something."""
        seen.update(name=name, inner=inner, times=times)

    app = typer.Typer()
    app.command()(command)
    return CliRunner().invoke(app, words).exit_code, seen


def test_a_command_is_handed_its_bundles() -> None:
    code, seen = called("me", "--size", "7", "--loud", "--times", "2")
    assert code == 0
    assert seen["inner"].words() == {"size": 7, "loud": True}
    assert (seen["name"], seen["times"]) == ("me", 2)


def test_what_is_not_given_has_its_default() -> None:
    assert called("me")[1]["inner"].words() == {"size": 3, "loud": False}
    assert called()[0] == 2  # the argument is missing


def test_bundles_within_bundles_are_taken_apart_and_put_together() -> None:
    seen = []

    @taken_apart
    def command(outer: Outer) -> None:
        seen.append(outer)

    names = list(inspect.signature(command).parameters)
    assert names == [
        "outer_inner_size",
        "outer_inner_loud",
        "outer_longer_size",
        "outer_longer_loud",
        "outer_longer_word",
    ]
    command(**dict(zip(names, (1, True, 2, False, "w"), strict=True)))
    assert seen[0].inner.words() == {"size": 1, "loud": True}
    assert seen[0].longer.words() == {"size": 2, "loud": False, "word": "w"}


def test_a_required_option_has_no_default() -> None:
    found = {p.name: p.default for p in parameters("x", Longer, REQUIRED)}
    assert found == {"x_size": 3, "x_loud": False, "x_word": inspect.Parameter.empty}


def test_the_command_keeps_its_name_and_words() -> None:
    @taken_apart
    def command(inner: Inner) -> None:
        """Do something."""

    assert (command.__name__, command.__doc__) == ("command", "Do something.")


def test_a_changed_bundle_leaves_the_first_as_it_was() -> None:
    first = Inner(size=1, loud=False)
    second = first.changed(loud=True)
    assert (first.loud, second.loud, second.size) == (False, True, 1)
    assert isinstance(second, Inner)


BUNDLES = [
    kind
    for kind in vars(opt).values()
    if isinstance(kind, type) and issubclass(kind, ChoiceBundle) and kind is not ChoiceBundle
]


@pytest.mark.parametrize("bundle", BUNDLES, ids=lambda b: b.__name__)
def test_a_bundle_has_the_words_that_its_choice_parses(bundle: type[ChoiceBundle]) -> None:
    """So that no option is without effect, and no word of a choice cannot be typed."""
    module, _, name = bundle.HOME.partition(":")
    parsed = getattr(import_module(f"vftcli.{module}"), name).parsed
    words = inspect.signature(parsed).parameters
    assert set(bundle.declared()) == set(words)


@pytest.mark.parametrize("bundle", BUNDLES, ids=lambda b: b.__name__)
def test_a_bundle_that_says_nothing_is_the_choice_s_default(bundle: type[ChoiceBundle]) -> None:
    """What is not given is decided by the room, not a second time by the command line."""
    nothing = {p.name.removeprefix("x_"): p.default for p in parameters("x", bundle, REQUIRED)}
    if REQUIRED in nothing.values():
        nothing["reference"] = "zero"
    choice = bundle(**nothing).choice()
    if choice is None:
        assert bundle in {opt.WrenchOptions, opt.ReferenceOptions}
        return
    default = (
        type(choice)(name="zero") if bundle is opt.RequiredReferenceOptions else type(choice)()
    )
    assert choice == default
