"""Observer parameters: what the command line sets, what the robot file gives, what is left over."""

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import assignment, did_you_mean, numbers

Value = float | str | list[float]
Gains = Mapping[str, Mapping[str, Any]]
"""Section of a file → parameter → number, list or word."""

Settings = dict[str, dict[str, Value]]
"""Section ("fdo", "gmo", "kfo", or one observer's own name) → parameter → value."""

PARAMETERS: dict[str, tuple[str, ...]] = {
    "fdo": ("omega",),
    "gmo": ("gain",),
    "kfo": ("r_diag", "q_p_diag", "q_tau_diag", "decay", "noise_convention"),
}
"""Section → the parameters it takes; `kfo` holds for every Kalman filter."""

FORM = "OBSERVER.PARAMETER=VALUE, as gmo.gain=30 or gmo.gain=5,3,4,10,10,10"
"""What an assignment of ``--set`` looks like."""

WORDS = {"noise_convention"}
"""Parameters whose value is a word."""


def parse_settings(assignments: Iterable[str], sections: Mapping[str, Sequence[str]]) -> Settings:
    """Read ``observer.parameter=VALUE`` assignments; a value is a number or one a joint.

    Args:
        assignments: The command line's ``--set`` values.
        sections: Section → parameters, `PARAMETERS` with the observers' own names added.

    Raises:
        ParameterError: If an assignment is malformed or names nothing there is.
    """
    settings: Settings = {}
    for text in assignments:
        name, value = assignment(text, "--set", FORM)
        section, dot, parameter = name.partition(".")
        if not dot:
            raise ParameterError(f"--set {text!r} is not {FORM}")
        check_name(section, parameter, sections)
        settings.setdefault(section, {})[parameter] = parse_value(parameter, value, text)
    return settings


def check_name(section: str, parameter: str, sections: Mapping[str, Sequence[str]]) -> None:
    """Raise a ParameterError that lists what there is unless the name exists."""
    if section not in sections:
        raise ParameterError(
            f"no observer {section!r} to set.{did_you_mean(section, sections)} "
            f"There is {', '.join(sections)}"
        )
    if parameter not in (known := sections[section]):
        raise ParameterError(
            f"{section} has no parameter {parameter!r}.{did_you_mean(parameter, known)} "
            f"It has {', '.join(known)}"
        )


def parse_value(parameter: str, text: str, whole: str) -> Value:
    """The value of an assignment: a word for the parameters in `WORDS`, else one number or several.

    Raises:
        ParameterError: If it is no number, or not a finite one.
    """
    if parameter in WORDS:
        return text
    values = numbers(text)
    if values is None:
        raise ParameterError(f"--set {whole!r}: {text!r} is not a number or a list")
    if not all(np.isfinite(values)):
        raise ParameterError(f"--set {whole!r}: every number must be finite")
    return values[0] if len(values) == 1 else list(values)


def load_gains(path: Path, sections: Mapping[str, Sequence[str]]) -> Gains:
    """Read gains from a file of their own, ``[observers.*]`` as in a robot file.

    Args:
        path: A TOML file with ``[observers.SECTION]`` tables.
        sections: Sections and parameters there are.

    Raises:
        ParameterError: If it is no such file, or names a section or parameter there is not.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ParameterError(f"{path}: not a TOML file of gains: {error}") from None
    gains = document.get("observers")
    if not isinstance(gains, dict) or not all(isinstance(v, dict) for v in gains.values()):
        raise ParameterError(
            f"{path}: no [observers.*] tables; a gains file is what vftcli tune writes, as "
            "[observers.gmo] gain = 10.0"
        )
    for section, table in gains.items():
        for parameter in table:
            check_name(section, parameter, sections)
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
    """One number a joint from one number or a list of them. (n,)

    Raises:
        ParameterError: If the list has another length.
    """
    try:
        array = np.atleast_1d(np.asarray(value, dtype=np.float64))
    except (TypeError, ValueError):
        raise ParameterError(f"{what} is {value!r}; it must be a number or one a joint") from None
    if array.ndim != 1 or array.size not in {1, joints}:
        raise ParameterError(
            f"{what} has {array.size} values; give one, or one for each of {joints} joints"
        )
    return np.array(np.broadcast_to(array, (joints,)))
