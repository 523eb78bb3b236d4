"""What is written of a log of torques and a Jacobian: estimates, errors and `run.json`."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from vftcli.evaluation.logged_jacobian import JacobianJudgement
from vftcli.outputs.files import SEAL, OutputFolder, table_file
from vftcli.outputs.log.report import ERROR_TABLES, put_errors
from vftcli.outputs.log.run_record import CONVENTIONS, seal, versions
from vftcli.signals.arrays import Array
from vftcli.signals.columns import StatedFrame, described_schema
from vftcli.signals.shown import per_joint
from vftcli.signals.wrench import per_axis

FRAME = StatedFrame("axes and point of the log's own Jacobian, as force on the robot")


def jacobian_columns(made: JacobianJudgement) -> Iterator[tuple[str, Array]]:
    """Name and values of every column of `estimates.parquet`, in order."""
    both = [made.vendor, *([made.sensor] if made.sensor is not None else [])]
    yield "t", made.log.t
    for name, one in zip(("vendor", "reference"), both, strict=False):
        yield from per_joint(f"tau_ext/{name}", one.torque.tau)
    for name, one in zip(("vendor", "reference"), both, strict=False):
        yield from per_axis(f"wrench/{name}", one.wrench.values)
    if made.vendor.wrench.null_space is not None:
        yield "null_space/vendor", made.vendor.wrench.null_space
    if made.vendor.wrench.sigma_min is not None:
        yield "sigma_min", made.vendor.wrench.sigma_min


def write_jacobian_folder(
    path: Path, made: JacobianJudgement, command: str, *, force: bool = False
) -> str:
    """Write `estimates.parquet`, the errors if there are any, and `run.json`, all or nothing.

    Returns:
        The text of `run.json`.
    """
    import polars as pl

    table = pl.DataFrame(dict(jacobian_columns(made)))
    schema = described_schema(table, {"wrench/vendor": FRAME, "wrench/reference": FRAME})
    names = ("estimates.parquet", SEAL, *ERROR_TABLES)
    with OutputFolder(path, force, names) as folder:
        with table_file(folder / "estimates.parquet") as file:
            table.write_parquet(file, compression="zstd", arrow_schema=schema)
        put_errors(folder, "", made.errors, [])
        return seal(folder, SEAL, jacobian_record(made, command))


def jacobian_record(made: JacobianJudgement, command: str) -> dict[str, Any]:
    """What `run.json` holds."""
    log = made.log
    return {
        "command": command,
        "versions": versions(),
        "input": {
            "path": str(log.path),
            "sha256": log.sha256,
            "samples": len(log.t),
            "joints": log.tau_ext.shape[1],
            "start_s": float(log.t[0]),
            "end_s": float(log.t[-1]),
        },
        "robot": None,
        "observers": [],
        "reference": None if made.sensor is None else {"name": made.sensor.torque.name},
        "conventions": CONVENTIONS,
        "repairs": list(log.remarks),
        "notes": list(made.remarks),
    }
