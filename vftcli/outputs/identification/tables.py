"""Tables of an identification: residuals of every log, identified numbers."""

from vftcli.identification.result import Identification
from vftcli.outputs.grid import Column, Entry, Grid, joint_columns, terminal


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
    rows: list[tuple[Entry, ...]] = [
        (f"{log}, {role}, {model}", *values, sum(values) / len(values))
        for (log, role, model), values in residual_rows(found)
    ]
    numbers = (*joint_columns(found.robot.joints), Column("mean"))
    return Grid(
        columns=(
            Column("residual rms [N·m]", words=True, width=44),
            *(column._replace(form=".3f", width=6) for column in numbers),
        ),
        rows=tuple(rows),
    )


def residual_rows(found: Identification) -> list[tuple[tuple[str, str, str], list[float]]]:
    """Log, role and model, with the RMS of each joint. [N·m]"""
    # Two logs of one label are told apart by their place in the command.
    keys = ("log_index", "log", "role", "model")
    return [
        ((str(log), str(role), str(model)), part["rms_Nm"].to_list())
        for (_, log, role, model), part in found.residuals.group_by(*keys, maintain_order=True)
    ]


def parameter_grid(found: Identification) -> Grid:
    """The identified numbers with their spread, and what the profile had."""
    rows = []
    for row in found.parameters.iter_rows(named=True):
        unit = row["unit"] + ("" if row["determined"] else "  (not determined)")
        numbers = (f"{row[k]:{form}}" for k, form in (("value", ".5g"), ("sd", ".2g")))
        rows.append((row["parameter"], row["joint"], *numbers, f"{row['profile']:.5g}", unit))
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
