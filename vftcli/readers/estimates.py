"""Estimates written by `vftcli estimate`, read again as a log whose torques are an observer's."""

from pathlib import Path

from vftcli.signals.errors import LogError

PREFIX = "tau_ext/"


def estimates_columns(path: Path, observer: str) -> str | None:
    """How to read an ``estimates.parquet`` with one observer's torque as its tau_ext.

    Args:
        path: Any log.
        observer: Name of the observer whose columns are wanted.

    Returns:
        A description for ``--columns``, or None if the file is not one of ours.

    Raises:
        LogError: If it is, and holds no such observer; the message lists those it holds.
    """
    if not path.is_file():
        return None
    with path.open("rb") as file:
        if file.read(4) != b"PAR1":
            return None
    import polars as pl

    with path.open("rb") as file:  # polars cannot open a name that is not UTF-8
        names = pl.read_parquet_schema(file)
    held = sorted({n.split("/")[1] for n in names if n.startswith(PREFIX) and n.count("/") == 2})
    if not held or "t" not in names or "q/1" not in names:
        return None
    if observer not in held:
        raise LogError(
            f"{path}: holds no estimates of {observer!r}; it holds {', '.join(held)}. Choose one "
            "with --observer."
        )
    return f"t=t,q=q/{{i}},tau_ext={PREFIX}{observer}/{{i}}"
