"""Observer parameters: what the command line sets, what the robot file gives, what is left over."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from vftcli.robots.profile import checked_gains
from vftcli.robots.robot_file import RobotFile
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import assignment, check_known, shown
from vftcli.signals.schema import PER_JOINT, TEXT, set_value

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
        given: Value = value
        if parameter not in WORDS:
            given = set_value(value, text)
            check_range(parameter, given, f"--set {text!r}")
        settings.setdefault(section, {})[parameter] = given
    return settings


def check_name(
    section: str, parameter: str, sections: Mapping[str, Sequence[str]], where: str = ""
) -> None:
    """Raise a ParameterError that lists what there is unless the name exists."""
    check_known(section, sections, f"{where}no observer {section!r} to set")
    known = sections[section]
    check_known(parameter, known, f"{where}{section} has no parameter {parameter!r}")


def check_range(parameter: str, values: float | list[float], where: str) -> None:
    """Raise a ParameterError unless every number is one that a parameter can have."""
    largest = LARGEST.get(parameter, LARGEST_VARIANCE)
    for value in values if isinstance(values, list) else [values]:
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
            check_name(section, parameter, sections, f"{where}: ")
            name = f"{where}: {section}.{parameter}"
            (TEXT if parameter in WORDS else PER_JOINT).check(name, value)
            if parameter not in WORDS:
                check_range(parameter, value, name)


def load_gains(path: Path, sections: Mapping[str, Sequence[str]]) -> Gains:
    """Read gains from a file of their own, ``[observers.*]`` as in a robot file.

    Args:
        path: A TOML file with ``[observers.SECTION]`` tables.
        sections: Sections and parameters there are.
    """
    if not path.exists():
        raise ParameterError(
            f"{path}: no such file of gains; --gains takes auto, paper, or a file of `vftcli tune`"
        )
    root = RobotFile(path, "file of gains").root
    if "observers" not in root.values:
        raise ParameterError(
            f"{path}: no [observers.*] tables; a gains file is what vftcli tune writes, as "
            "[observers.gmo] gain = 10.0"
        )
    gains = checked_gains(root.section("observers"))
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
