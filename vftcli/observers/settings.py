"""Observer parameters: what the command line sets, what the robot file gives, what is left over."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import assignment, did_you_mean, numbers, shown, toml_tables

Value = float | str | list[float]
Gains = Mapping[str, Mapping[str, Any]]  #: Section of a file → parameter → number, list or word.
#: Section ("fdo", "gmo", "kfo", or one observer's own name) → parameter → value.
Settings = dict[str, dict[str, Value]]
#: Section → the parameters it takes; `kfo` holds for every Kalman filter.
PARAMETERS: dict[str, tuple[str, ...]] = {
    "fdo": ("omega",),
    "gmo": ("gain",),
    "kfo": ("r_diag", "q_p_diag", "q_tau_diag", "decay", "noise_convention"),
}
#: What an assignment of ``--set`` looks like.
FORM = "OBSERVER.PARAMETER=VALUE, as gmo.gain=30 or gmo.gain=5,3,4,10,10,10"
WORDS = {"noise_convention"}  #: Parameters whose value is a word.
#: Parameters that are rates: no log resolves a microsecond. [1/s]
LARGEST = {"omega": 1e6, "gain": 1e6, "decay": 1e6}
#: Every other number is a variance: 3·10⁷ N·m, or of its momentum, or gained in a second.
LARGEST_VARIANCE = 1e15
#: Smallest size of a number that is not zero: the ratio of two must stay a number.
SMALLEST = 1e-15


def parse_settings(assignments: Iterable[str], sections: Mapping[str, Sequence[str]]) -> Settings:
    """Read ``observer.parameter=VALUE`` assignments; a value is a number or one a joint."""
    settings: Settings = {}
    for text in assignments:
        name, value = assignment(text, "--set", FORM)
        section, dot, parameter = name.partition(".")
        if not dot:
            raise ParameterError(f"--set {text!r} is not {FORM}")
        check_name(section, parameter, sections)
        settings.setdefault(section, {})[parameter] = parse_value(parameter, value, text)
    return settings


def check_name(
    section: str, parameter: str, sections: Mapping[str, Sequence[str]], where: str = ""
) -> None:
    """Raise a ParameterError that lists what there is unless the name exists."""
    start = f"{where}: " if where else ""
    if section not in sections:
        raise ParameterError(
            f"{start}no observer {section!r} to set.{did_you_mean(section, sections)} "
            f"There is {', '.join(sections)}"
        )
    if parameter not in (known := sections[section]):
        raise ParameterError(
            f"{start}{section} has no parameter {parameter!r}.{did_you_mean(parameter, known)} "
            f"It has {', '.join(known)}"
        )


def parse_value(parameter: str, text: str, whole: str) -> Value:
    """The value of an assignment: a word for a name in `WORDS`, else one number or several."""
    if parameter in WORDS:
        return text
    values = numbers(text)
    if values is None:
        raise ParameterError(f"--set {whole!r}: {text!r} is not a number or a list")
    check_numbers(parameter, values, f"--set {whole!r}")
    return values[0] if len(values) == 1 else list(values)


def check_numbers(parameter: str, values: Iterable[Any], where: str) -> None:
    """Raise a ParameterError unless every value is a number that a parameter can have."""
    largest = LARGEST.get(parameter, LARGEST_VARIANCE)
    for value in values:
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ParameterError(f"{where} holds {shown(value)}; give a number or one a joint")
        # What is not a number is neither zero nor between the two.
        if value != 0 and not SMALLEST <= abs(value) <= largest:
            raise ParameterError(
                f"{where}: {shown(value)} is out of range; every number must be finite, "
                f"{SMALLEST:g} to {largest:g} in size"
            )


def check_gains(gains: Gains, sections: Mapping[str, Sequence[str]], where: str) -> None:
    """Raise a ParameterError unless a file's gains are of observers and parameters there are.

    Args:
        gains: The ``[observers.*]`` tables.
        sections: Sections and parameters there are.
        where: The file, for the message.
    """
    for section, table in gains.items():
        for parameter, value in table.items():
            check_name(section, parameter, sections, where)
            name = f"{where}: {section}.{parameter}"
            if parameter not in WORDS:
                check_numbers(parameter, value if isinstance(value, list) else [value], name)
            elif not isinstance(value, str):
                raise ParameterError(f"{name} is {shown(value)}; it must be a word in quotes")


def load_gains(path: Path, sections: Mapping[str, Sequence[str]]) -> Gains:
    """Read gains from a file of their own, ``[observers.*]`` as in a robot file.

    Args:
        path: A TOML file with ``[observers.SECTION]`` tables.
        sections: Sections and parameters there are.
    """
    try:
        document = toml_tables(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise ParameterError(
            f"{path}: no such file of gains; --gains takes auto, paper, or a file of `vftcli tune`"
        ) from None
    except OSError as error:
        raise ParameterError(f"{path}: cannot be read as gains ({error.strerror})") from None
    except UnicodeDecodeError:
        raise ParameterError(f"{path}: not a TOML file of gains: not text") from None
    except ParameterError as error:
        raise ParameterError(f"{path}: not a TOML file of gains: {error}") from None
    gains = document.get("observers")
    if not isinstance(gains, dict) or not all(isinstance(v, dict) for v in gains.values()):
        raise ParameterError(
            f"{path}: no [observers.*] tables; a gains file is what vftcli tune writes, as "
            "[observers.gmo] gain = 10.0"
        )
    check_gains(gains, sections, str(path))
    return gains


def overlay_gains(under: Gains, over: Gains) -> Gains:
    """Gains of one source with those of another put over them, parameter by parameter."""
    names = dict.fromkeys((*under, *over))
    return {name: {**under.get(name, {}), **over.get(name, {})} for name in names}


def parameters_given(
    section: str, name: str, *sources: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Parameters of one observer: later sources win, its own section over the shared one."""
    found: dict[str, Any] = {}
    for source in sources:
        found |= source.get(section, {})
        # kfo-zoh.r_diag is meant for that one filter, kfo.r_diag for all of them.
        if name != section:
            found |= source.get(name, {})
    return found


def joint_values(value: Any, joints: int, what: str) -> Array:  # noqa: ANN401 - TOML is untyped
    """One number a joint from one number or a list of them. (n,)"""
    try:
        array = np.atleast_1d(np.asarray(value, dtype=np.float64))
    except (TypeError, ValueError):
        raise ParameterError(f"{what} is {value!r}; it must be a number or one a joint") from None
    if array.ndim != 1 or array.size not in {1, joints}:
        raise ParameterError(
            f"{what} has {array.size} values; give one, or one for each of {joints} joints"
        )
    return np.array(np.broadcast_to(array, (joints,)))
