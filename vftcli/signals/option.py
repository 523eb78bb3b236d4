"""Option: how a value is typed and what `--help` says of it, beside the field that holds it.

A room's choice is a dataclass whose fields say how a user gives them, once for the command line,
the file of options and notebooks::

    period: Annotated[float | None, Option("--period", "S", "Commanded period.")] = None
"""

from collections.abc import Callable
from inspect import get_annotations
from typing import Any, ClassVar, NamedTuple, Self, get_args

#: Headings of the options that commands share, in their order.
LOG, ESTIMATE, COMPARE, WRENCH, WRITE, OUTPUT = GROUPS = (
    "The log", "How to estimate", "How to compare", "The wrench", "What to write", "Output"
)  # fmt: skip


class Option(NamedTuple):
    """How one value is typed, and what `--help` says of it."""

    name: str  #: As it is typed, ``-v/--details`` where it has two names; "" of an argument.
    metavar: str  #: What its value is called, "" of an option that is given or not.
    help: str  #: What it means; the short help shows the first sentence.
    #: What makes the field's value of the typed text, None where that is the value.
    reads: Callable[[Any], Any] | None = None
    several: bool = False  #: Whether it may be repeated.
    seldom: bool = False  #: Whether only `--help-all` shows it.
    group: str = ""  #: The heading under which it is listed, "" for the command's own.
    shows_default: bool = False  #: Whether `--help` says what a choice takes if it is not given.
    least: float | None = None  #: Smallest number that is taken.
    most: float | None = None  #: Largest number that is taken.

    def read(self, typed: Any) -> Any:  # noqa: ANN401 - texts, numbers, lists of them
        """What a typed value means, None where nothing was typed."""
        return self.reads(typed) if self.reads and typed is not None else typed

    @property
    def word(self) -> str:
        """The name as a keyword, ``robot_arg`` of ``--robot-arg``."""
        return self.name.rpartition("--")[2].replace("-", "_")


class Choice:
    """What a user may choose of a room: a dataclass, its fields annotated with an `Option` each."""

    GROUP: ClassVar[str] = ""  #: Heading of its options.

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
        """One of the options, for a command that has it in another way."""
        return cls.options()[word][2]._replace(**changed)

    @classmethod
    def parsed(cls, **words: Any) -> Self:  # noqa: ANN401 - texts, numbers, lists of them
        """The choice that typed words state; None and an empty list are as if not given."""
        options, values = cls.options(), {}
        for word, typed in words.items():
            field, _, option = options[word]
            if typed is not None and (typed or not option.several):
                values[field] = option.read(tuple(typed) if option.several else typed)
        return cls(**values)
