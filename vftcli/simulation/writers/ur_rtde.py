"""SDU's ur_rtde recorder: commas, LF, every double with six decimals."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from vftcli.simulation.experiment import Simulation
from vftcli.simulation.writers.rtde import recipe, ur_columns


def write_ur_rtde(path: Path, simulation: Simulation) -> None:
    """Write the log as `startFileRecording` does, `safety_mode` in place of `safety_status`."""
    left_out = {"joint_position_deviation_ratio"}
    names = [n for n in recipe(simulation) if n not in left_out]
    names = ["safety_mode" if n == "safety_status" else n for n in names]
    columns = ur_columns(simulation, names)
    texts = [as_text(values) for values in columns.values()]
    lines = [",".join(columns), *map(",".join, zip(*texts, strict=True))]
    path.write_bytes(("\n".join(lines) + "\n").encode("ascii"))


def as_text(values: Iterable[Any]) -> list[str]:
    """A column as the recorder prints it: doubles with six decimals, integers bare."""
    return [f"{v:.6f}" if isinstance(v, float) else str(v) for v in values]
