"""Gains in a file of their own: ``[observers.*]`` as in a robot file, for ``--set-file``."""

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from vftcli.observers.settings import check_name
from vftcli.signals.errors import ParameterError

Gains = Mapping[str, Mapping[str, Any]]
"""Section → parameter → number, list or word."""


def load_gains(path: Path, sections: Mapping[str, Sequence[str]]) -> Gains:
    """Read a gains file.

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
