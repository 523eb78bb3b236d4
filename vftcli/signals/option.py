"""Option: the command-line form of a field, and its words in `--help`.

Each field of a room's choice has one, for the command line, the file of options and
notebooks alike. Rare ones are settings, given by ``--set NAME=VALUE``::

    frame: Annotated[str, Option("--frame", "FRAME", "Give the wrench in this frame.")] = "flange"
    period: Annotated[float | None, Option("two-cycle.period", "S", "Commanded period.")] = None
"""

import re
import typing
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from inspect import get_annotations
from pathlib import Path
from types import MappingProxyType, NoneType
from typing import Annotated, Any, ClassVar, NamedTuple, Self, TypeVar, get_args

from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import check_known, did_you_mean

#: Headings of the options that commands share, in their order.
LOG, ESTIMATE, COMPARE, WRENCH, WRITE, OUTPUT = GROUPS = (
    "The log", "How to estimate", "How to compare", "The wrench", "What to write", "Output"
)  # fmt: skip


FILE = "file:"  #: Head of a value with a path, where others are names.
#: A value in a metavar, as `svg`; numbers and paths are none.
WORD = re.compile("[a-z][a-z0-9-]+")


def text_of(value: object, name: str) -> str:
    """A value as typed, yes or no, numbers apart by commas; or a ParameterError."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    each = value if isinstance(value, list | tuple) else [value]
    if not each or any(isinstance(x, bool) or not isinstance(x, WORDS) for x in each):
        raise ParameterError(f"{name} is {value!r}; expected a text or a number")
    return ",".join(map(str, each))


WORDS = str | int | float | Path  #: What a value is made of.


class Option(NamedTuple):
    """One option: its form on the command line, and its words in `--help`."""

    #: As typed, ``-v/--details``; "" of an argument; dotted of a setting.
    name: str
    metavar: str  #: Its value's name, "" of an option without one.
    help: str  #: What it means; the short help shows the first sentence.
    #: What makes the value of the typed text; None: it is the value.
    reads: Callable[[Any], Any] | None = None
    several: bool = False  #: Whether it may be repeated.
    group: str = ""  #: Its heading, "" for the command's own.
    least: float | None = None  #: Smallest number allowed.
    most: float | None = None  #: Largest number allowed.
    #: What a shell offers for its value; None for the words of `metavar`.
    completes: Callable[[], Iterable[str]] | None = None

    def values(self) -> list[str]:
        """Completions of its value in a shell; none for files."""
        if self.completes is not None:
            return list(self.completes())
        return [word for word in self.metavar.split("|") if WORD.fullmatch(word)]

    def read(self, typed: Any) -> Any:  # noqa: ANN401 - texts, numbers, lists of them
        """The value of a typed text, or None; a ParameterError of no word of `metavar`."""
        words = self.metavar.split("|")
        if isinstance(typed, str) and words[1:] and all(map(WORD.fullmatch, words)):
            head = f"--set {self.name}=" if self.is_setting else f"{self.typed} "
            check_known(typed, words, f"{head}{typed}")
        return self.reads(typed) if self.reads and typed is not None else typed

    def keyword(self, value: object, log: type = NoneType) -> object:
        """A keyword's value as typed, or a ParameterError; None and a `log` as they are."""
        if value is None or (not self.metavar and isinstance(value, bool)):
            return value
        if not self.metavar:
            raise ParameterError(f"{self.word} is {value!r}; expected True or False")
        if not self.several:
            return text_of(value, self.word)
        each = value if isinstance(value, list | tuple) else [value]
        held = log if "LOG" in self.metavar else ()
        return [one if isinstance(one, held) else text_of(one, self.word) for one in each]

    @property
    def is_setting(self) -> bool:
        """Whether it is given by ``--set NAME=VALUE``."""
        return bool(self.name) and not self.name.startswith("-")

    @property
    def typed(self) -> str:
        """The name as a complaint gives it, ``--details`` or a setting's."""
        return self.name.rpartition("/")[2]

    @property
    def word(self) -> str:
        """The name as a keyword, ``reference_columns`` of ``--reference-columns``."""
        return self.name if self.is_setting else self.name.rpartition("--")[2].replace("-", "_")

    def number(self, text: str, kind: type[int] | type[float]) -> float:
        """The number in range that a setting's text states."""
        try:
            value = kind(text)
        except ValueError:
            value = None
        if value is None or not (self.least is None or value >= self.least):
            bound = "" if self.least is None else f" of {self.least:g} or more"
            what = "a whole number" if kind is int else "a number"
            raise ParameterError(f"--set {self.name}={text} is not {what}{bound}")
        return value


def names_at(place: str) -> Callable[[], Iterable[str]]:
    """A function that loads and lists the names of ``module:TABLE``."""
    module, _, table = place.partition(":")
    return lambda: getattr(import_module(f"vftcli.{module}"), table)


def is_yes(text: str) -> bool:
    """Whether a setting's text, yes or no, is yes."""
    return text == "yes"


#: Name of the setting that gathers what has a name of its own per robot, as ``gmo.gain``.
NUMBERS = "numbers"


@typing.dataclass_transform(frozen_default=True, kw_only_default=True)
class Choice:
    """A user's choices in a room: a frozen dataclass of `Option` fields."""

    GROUP: ClassVar[str] = ""  #: Heading of its options.

    def __init_subclass__(cls) -> None:
        dataclass(frozen=True, kw_only=True)(cls)

    @classmethod
    def options(cls) -> dict[str, tuple[str, Any, Option]]:
        """Word of every option → its field, the field's type, and the option."""
        found = {}
        for field, kind in get_annotations(cls).items():
            if hasattr(kind, "__metadata__"):
                what, option = get_args(kind)
                found[option.word] = (field, what, option)
        return found

    @classmethod
    def option(cls, word: str, **changed: Any) -> Option:  # noqa: ANN401 - an option's fields
        """One of the options with other fields."""
        return cls.options()[word][2]._replace(**changed)

    @classmethod
    def takes(cls, name: str) -> bool:
        """Whether there is a setting of this name."""
        found = cls.options().get(name)
        return found is not None and found[2].is_setting and name != NUMBERS

    @classmethod
    def parsed(
        cls,
        *,
        settings: Mapping[str, str] = MappingProxyType({}),
        **words: Any,  # noqa: ANN401 - texts, numbers, lists of them
    ) -> Self:
        """The choice that words and its own settings state; None and [] state nothing."""
        options, values = cls.options(), {}
        own = {name: text for name, text in settings.items() if cls.takes(name)}
        words |= {name: own.pop(name) for name in options if name in own}
        if own:
            words[NUMBERS] = [f"{name}={text}" for name, text in own.items()]
        for word, typed in words.items():
            field, what, option = options[word]
            if typed is not None and (typed or not option.several):
                kinds = [kind for kind in (int, float) if kind in (what, *get_args(what))]
                if option.is_setting and kinds and not option.reads and isinstance(typed, str):
                    values[field] = option.number(typed, kinds[0])
                else:
                    values[field] = option.read(tuple(typed) if option.several else typed)
        return cls(**values)


class Anyway(Choice):
    """Whether to go on where results mean nothing."""

    GROUP = LOG

    anyway: Annotated[
        bool, Option("--anyway", "", "Continue despite errors; the outputs are marked.")
    ]


C = TypeVar("C", bound=Choice)


class Asked(NamedTuple):
    """The options of a command or a call, as typed."""

    words: Mapping[str, Any]  #: Word of an option → what was given, or None.
    settings: Mapping[str, str]  #: Name → text of the settings.
    line: str  #: The command or call, as `run.json` holds it.

    @property
    def anyway(self) -> bool:
        """Whether to continue despite errors."""
        return bool(self.words.get("anyway"))

    def of(self, kind: type[C]) -> C:
        """The choice of a room that they state, checked."""
        own = {word: self.words[word] for word in kind.options() if word in self.words}
        return kind.parsed(settings=self.settings, **own)

    def states(self, kind: type[Choice]) -> bool:
        """Whether they say anything of a room's choice."""
        return any(map(self.words.get, kind.options())) or any(map(kind.takes, self.settings))

    def but(self, **words: Any) -> "Asked":  # noqa: ANN401 - texts, numbers, lists of them
        """This request with other words for some options."""
        return self._replace(words={**self.words, **words})


def settings_by_name(choices: Iterable[type[Choice]]) -> dict[str, tuple[Option, object]]:
    """Name → setting and default, of every setting of the choices."""
    return {
        option.name: (option, getattr(kind, field, None))
        for kind in choices
        for field, _, option in kind.options().values()
        if option.is_setting
    }


def settings_as_typed(
    given: Mapping[str, object], choices: Iterable[type[Choice]], by: str = ""
) -> dict[str, str]:
    """Name → text of settings, `by` before each name; a ParameterError of others."""
    there = tuple(choices)
    for name in given:
        if not any(kind.takes(name) for kind in there):
            near = did_you_mean(name, settings_by_name(there))
            raise ParameterError(
                f"{by}{name} is no setting here; vftcli help settings lists all.{near}"
            )
    return {name: text_of(value, f"{by}{name}") for name, value in given.items()}


def interval(text: str) -> tuple[float, float]:
    """First and last time of ``A:B``, infinite where an end is left out. [s]"""
    left, colon, right = text.partition(":")
    try:
        start = float(left) if left.strip() else float("-inf")
        stop = float(right) if right.strip() else float("inf")
    except ValueError:
        colon = ""
    if not colon or not start < stop:
        raise ParameterError(
            f"interval {text!r} is not A:B with A < B, in seconds from the log's first sample"
        )
    return start, stop


def interval_text(start: float, stop: float) -> str:
    """The ``A:B`` that `interval` reads as these times. [s]"""
    return ":".join("" if abs(end) == float("inf") else f"{end:g}" for end in (start, stop))


def numbers(text: str) -> tuple[float, ...] | None:
    """The numbers of ``A,B,C``, None where a part is no number."""
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        return None


def assignment(text: str, option: str, form: str) -> tuple[str, str]:
    """Key and value of ``KEY=VALUE``, without the blanks around them."""
    key, _, value = text.partition("=")
    if not key.strip() or not value.strip():
        raise ParameterError(f"{option} {text!r} is not {form}")
    return key.strip(), value.strip()


def set_value(text: str, whole: str) -> float | list[float]:
    """One number or several of an assignment of ``--set``."""
    values = numbers(text)
    if values is None:
        raise ParameterError(f"--set {whole!r}: {text!r} is not a number or a list")
    return values[0] if len(values) == 1 else list(values)
