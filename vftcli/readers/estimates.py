"""Estimates written by `vftcli estimate`, read again as a log whose torques are an observer's."""

from pathlib import Path

from vftcli.signals.errors import LogError

PREFIX = "tau_ext/"


def estimates_columns(path: Path, observer: str) -> str | None:
    """How to read an ``estimates.parquet`` with one observer's torque as its tau_ext.

    Returns:
        A description for ``--columns``, or None if the file is not one of ours.
    """
    if not (held := stored_observers(path)):
        return None
    if observer not in held:
        raise LogError(
            f"{path}: holds no estimates of {observer!r}; it holds {', '.join(held)}. Choose one "
            "with --observer."
        )
    return f"t=t,q=q/{{i}},tau_ext={PREFIX}{observer}/{{i}}"


def stored_observers(path: Path) -> list[str]:
    """The observers whose estimates a file holds, none if it is not one of ours."""
    if not path.is_file():
        return []
    with path.open("rb") as file:
        if file.read(4) != b"PAR1":
            return []
    import polars as pl
    from polars.exceptions import PolarsError

    try:
        with path.open("rb") as file:  # polars cannot open a name that is not UTF-8
            names = pl.read_parquet_schema(file)
    except PolarsError:  # what is damaged is said by whoever reads it
        return []
    held = sorted({n.split("/")[1] for n in names if n.startswith(PREFIX) and n.count("/") == 2})
    return held if "t" in names and "q/1" in names else []


def refuse_estimates(path: Path) -> None:
    """Raise where a log is needed and a file of our estimates is given."""
    if stored_observers(path):
        raise LogError(
            f"{path} holds estimates, not what the drives measured; give the log. `vftcli "
            "contacts` lists its contacts and `vftcli admit` replays its force as they are"
        )
