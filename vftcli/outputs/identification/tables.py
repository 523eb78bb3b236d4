"""Tables of an identification: residuals of every log, identified numbers."""

from math import isfinite

import polars as pl

from vftcli.identification.result import Identification
from vftcli.outputs.grid import Column, Entry, Grid, joint_columns, terminal
from vftcli.outputs.quantity import DASH, signed


def tables_text(found: Identification) -> str:
    """Residuals and identified numbers for the terminal."""
    parts = []
    if not found.residuals.is_empty():
        parts.append(terminal(residual_grid(found)) + "\n")
    if not found.parameters.is_empty():
        parts.append(terminal(parameter_grid(found)))
    return "".join(parts).removesuffix("\n")


def residual_grid(found: Identification) -> Grid:
    """RMS of measured less predicted torque, a row for each log, role and model. [N·m]"""
    # Two logs of one label are told apart by their place in the command.
    keys = ("log_index", "log", "role", "model")
    rows: list[tuple[Entry, ...]] = []
    for (_, *names), part in found.residuals.group_by(*keys, maintain_order=True):
        values = part["rms_Nm"].to_list()
        rows.append((", ".join(map(str, names)), *values, sum(values) / len(values)))
    numbers = (*joint_columns(found.robot.joints), Column("mean"))
    return Grid(
        columns=(
            Column("residual rms [N·m]", words=True, width=44),
            *(column._replace(form=".3f", width=6) for column in numbers),
        ),
        rows=tuple(rows),
    )


def parameter_grid(found: Identification) -> Grid:
    """The identified numbers with their spread, and what the profile had."""
    rows = []
    for row in found.parameters.iter_rows(named=True):
        unit = row["unit"] + ("" if row["determined"] else "  (not determined)")
        # A dash for what the profile does not have, or the log does not determine: it is no zero.
        texts = [
            f"{row[key]:{form}}" if isfinite(row[key]) else DASH
            for key, form in (("value", ".5g"), ("sd", ".2g"), ("profile", ".5g"))
        ]
        rows.append((row["parameter"], row["joint"], *texts, unit))
    return Grid(
        columns=(
            Column("number", words=True, width=19),
            Column("joint", width=4),
            Column("value", width=10),
            Column("sd", width=8),
            Column("profile", width=10),
            Column("unit", words=True),
        ),
        rows=tuple(rows),
    )


def shape_choice_grid(choices: pl.DataFrame) -> Grid:
    """How the friction models competed on what was left out of the fit."""
    return Grid(
        title="RMS on the fifth of the log left out; the simplest within 1 % of the best is chosen",
        columns=(Column("friction", words=True), *map(Column, ("joint", "RMS [N·m]", ""))),
        rows=tuple(
            (r["friction"], f"J{r['joint']}", r["cv_rms_Nm"], "chosen" if r["chosen"] else "")
            for r in choices.iter_rows(named=True)
        ),
    )


def base_grid(base: pl.DataFrame) -> Grid:
    """Base parameters as the least squares gave them."""
    numbers = (Column(head, form=signed) for head in ("value (SI)", "sd"))
    return Grid(
        title="Weighted least squares, before physical consistency",
        columns=(Column("parameter", words=True), *numbers, Column("determined")),
        rows=tuple(
            (r["parameter"], r["value"], r["sd"], "yes" if r["determined"] else "no")
            for r in base.iter_rows(named=True)
        ),
    )
