"""What `vftcli estimate` writes: the estimates as flat columns, `run.json`, extras on demand."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vftcli.analysis import Analysis
from vftcli.outputs.examination import overridden_lines
from vftcli.outputs.files import OutputFolder, table_file
from vftcli.outputs.log.run_record import run_record, seal
from vftcli.outputs.seals import SEAL
from vftcli.signals.arrays import Array
from vftcli.signals.columns import StatedFrame, described_schema
from vftcli.signals.shown import frame_of, per_joint
from vftcli.signals.wrench import per_axis
from vftcli.virtual_sensor.frames import FRAMES

if TYPE_CHECKING:
    import polars as pl

    from vftcli.contacts.contact_list import ContactList


def estimates_table(analysis: Analysis) -> "pl.DataFrame":
    """Time, motion, every observer's torque and the reference's, one flat column each.

    Columns: ``t`` [s]; ``q/1``… [rad]; ``dq/1``… [rad/s]; ``tau_ext/<observer>/1``… [N·m];
    ``sd/<observer>/1``… [N·m] where the observer gives one; ``tau_ext/reference/1``… [N·m];
    ``contact``, the row's number in the list of contacts or null, where they are listed; where a
    wrench is asked for, and of ``best`` where contacts are listed, ``wrench/<observer>/fx``…``mz``
    [N, N·m], null where the pose cannot tell it, ``wrench_sd/<observer>/fx``…,
    ``null_space/<observer>`` [N·m] and ``sigma_min`` [m]; with a bounded solver, what it says of
    the masked samples stands apart in ``wrench_masked/<observer>/fx``….
    What is not known is null.
    """
    return frame_of(columns(analysis))


def contact_column(t: Array, found: "ContactList") -> Array:
    """The number of the contact that each sample lies in, NaN outside of all. (T,)"""
    number = np.full(len(t), np.nan)
    for contact in found.contacts:
        number[(t >= contact.start) & (t <= contact.stop)] = contact.number
    return number


def columns(analysis: Analysis) -> Iterator[tuple[str, Array]]:
    """Name and values of every column, in order."""
    recording = analysis.recording
    yield "t", recording.t
    yield from per_joint("q", recording.q)
    if recording.dq is not None:
        yield from per_joint("dq", recording.dq)
    for estimate in analysis.estimates:
        yield from estimate.columns()
    if analysis.reference is not None:
        yield from per_joint("tau_ext/reference", analysis.reference.tau)
        if analysis.reference.sd is not None:
            yield from per_joint("sd/reference", analysis.reference.sd)
    yield from wrench_columns(analysis)
    if analysis.contacts is not None:
        yield "contact", contact_column(analysis.t, analysis.contacts)


def wrench_columns(analysis: Analysis) -> Iterator[tuple[str, Array]]:
    """The wrenches, their standard deviations and what the pose can tell, where asked for."""
    sensed = analysis.virtual_sensor
    bounded = sensed is not None and sensed.sensor.solver != "pinv"
    for wrench in analysis.wrenches:
        yield from wrench.columns()
        # By plain least squares nothing can be said there; a bounded solver says something finite.
        if bounded and wrench.hidden.any():
            said = np.where(wrench.hidden[:, None], wrench.values, np.nan)
            yield from per_axis(f"wrench_masked/{wrench.name}", said)
        if wrench.null_space is not None:
            yield f"null_space/{wrench.name}", wrench.null_space
    sigma = next((w.sigma_min for w in analysis.wrenches if w.sigma_min is not None), None)
    if sigma is not None:
        yield "sigma_min", sigma


def write_estimates(path: Path, analysis: Analysis) -> None:
    """Write the table as Parquet (zstd).

    Raises:
        OutputError: If the disk is full.
    """
    table = estimates_table(analysis)
    # For who finds the table alone, without the record beside it.
    doubts = overridden_lines(analysis.examinations)
    metadata = {"vftcli": json.dumps({"overridden": doubts})} if doubts else None
    schema = described_schema(table, frames_of(analysis))
    with table_file(path) as file:
        table.write_parquet(
            file,
            compression="zstd",
            compression_level=1,
            statistics=False,
            metadata=metadata,
            arrow_schema=schema,
        )


def frames_of(analysis: Analysis) -> dict[str, StatedFrame]:
    """The columns of each wrench, without the axis → their frame."""
    return {
        f"{kind}/{wrench.name}": StatedFrame(FRAMES[wrench.frame])
        for wrench in analysis.wrenches
        for kind in ("wrench", "wrench_sd", "wrench_masked")
    }


def write_csv(path: Path, analysis: Analysis) -> None:
    """Write the table as CSV with nine digits after the point; unknown is empty."""
    table = estimates_table(analysis)
    with table_file(path) as file:
        table.write_csv(file, float_precision=9)


EXTRAS = {
    "csv": ("estimates.csv",),
    "mcap": ("estimates.mcap",),
    "layouts": ("estimates.foxglove.json", "estimates.plotjuggler.xml"),
    "rrd": ("recording.rrd",),
}
"""Flag → names of its files."""


def extra_files(extras: Sequence[str]) -> tuple[str, ...]:
    """Names of the files of these extras."""
    return tuple(name for extra in extras for name in EXTRAS[extra])


def estimate_files(extras: Sequence[str]) -> tuple[str, ...]:
    """Names of the files of a folder with these extras."""
    return ("estimates.parquet", SEAL, *extra_files(extras))


def write_extras(
    folder: OutputFolder, place: str, analysis: Analysis, extras: Sequence[str]
) -> None:
    """Write what was asked for besides, below a place of a folder."""
    from vftcli.outputs.log.layouts import foxglove_layout, plotjuggler_layout
    from vftcli.outputs.log.mcap_output import write_mcap
    from vftcli.outputs.log.rerun_recording import write_rrd

    texts = dict(zip(EXTRAS["layouts"], (foxglove_layout, plotjuggler_layout), strict=True))
    writers = {"csv": write_csv, "mcap": write_mcap, "rrd": write_rrd}
    for extra in extras:
        for name in EXTRAS[extra]:
            if name in texts:
                folder.write(f"{place}{name}", texts[name](analysis))
            else:
                writers[extra](folder / f"{place}{name}", analysis)


def write_estimate_folder(
    path: Path, analysis: Analysis, command: str, extras: Sequence[str] = (), force: bool = False
) -> str:
    """Write `estimates.parquet`, `run.json` and the extras into a folder, all or nothing.

    Returns:
        The text of `run.json`.

    Raises:
        OutputError: If the folder cannot be written, or a file exists and `force` is not set.
    """
    record = run_record(analysis, command)
    with OutputFolder(path, force, estimate_files(extras)) as folder:
        write_estimates(folder / "estimates.parquet", analysis)
        # After the record: it names the packages that are loaded, and these made no number.
        write_extras(folder, "", analysis, extras)
        return seal(folder, SEAL, record)
