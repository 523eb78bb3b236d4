"""The meaning of our tables' columns, as the field metadata of Parquet files.

Any reader of the file sees unit, meaning, sign and frame beside each column:
``pyarrow.parquet.read_schema(path).field("tau_ext/gmo/1").metadata``.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from vftcli.signals.recording import COLUMN_NAMES, SIGNALS
from vftcli.signals.wrench import AXES, unit_of

if TYPE_CHECKING:
    import polars as pl

TORQUE, FORCE = "N·m", "N and N·m"

#: First part of a column's name → its unit and what it is.
COLUMNS: dict[str, tuple[str, str]] = {
    "t": ("s", "time"),
    "t_src_ns": ("ns", "time on the log's own clock"),
    **{COLUMN_NAMES.get(name, name): facts for name, facts in SIGNALS.items()},
    "tau_ext": (TORQUE, "external joint torque"),
    "sd": (TORQUE, "standard deviation of the external torque by the estimator's own account"),
    "band": (
        TORQUE,
        "standard deviation of the external torque, what the model errs by included",
    ),
    "wrench": (FORCE, "external force and moment"),
    "wrench_sd": (
        FORCE,
        "standard deviation of the external force and moment, outside of listed contacts of what "
        "would show",
    ),
    "wrench_masked": (FORCE, "force and moment by a prior, where the pose is near-singular"),
    "null_space": (TORQUE, "joint torque that no wrench at the flange explains"),
    "sigma_min": ("m", "smallest singular value of J, angular rows × 0.3 m"),
    "contact": (
        "1",
        "number of the contact in the list that the sample belongs to, null outside",
    ),
}
ON_ROBOT = "on the robot"  #: The environment's force.


class StatedFrame(NamedTuple):
    """Frame and sign of some wrench columns."""

    frame: str  #: Axes and reference point, in words.
    sign: str = ON_ROBOT  #: Whose force it is.


def column_facts(name: str, frames: Mapping[str, StatedFrame]) -> dict[str, str]:
    """Unit, meaning, sign and frame of a column; {} of an unknown one."""
    kind, group, last = name.partition("/")[0], *name.rpartition("/")[::2]
    if kind not in COLUMNS:
        return {}
    unit, meaning = COLUMNS[kind]
    # A simulated contact is a wrench or a torque by its own name.
    if kind == "contact" and group:
        unit, meaning = TORQUE, "force and moment, or joint torque, of one contact"
    if last in AXES:
        unit = unit_of(last)
    facts = {"unit": unit, "meaning": meaning}
    if last in AXES and group in frames:
        facts |= frames[group]._asdict()
    elif last.isdigit():
        facts["joint"] = last
        if kind == "tau_ext":
            facts["sign"] = ON_ROBOT
    return facts


def described_schema(
    table: "pl.DataFrame",
    frames: Mapping[str, StatedFrame] | None = None,
    metadata: Mapping[str, str] | None = None,
) -> Any:  # noqa: ANN401 - pyarrow is untyped
    """The table's pyarrow schema with each column's meaning, for ``write_parquet``."""
    import pyarrow as pa

    schema = table.clear().to_arrow().schema
    known = frames or {}
    fields = [field.with_metadata(column_facts(field.name, known)) for field in schema]
    return pa.schema(fields, metadata=metadata)
