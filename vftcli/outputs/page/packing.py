"""Series of a page as one text: int16 steps, differences, deflated, base64.

All lines of a log share a clock on the page, so one index is one moment. A short log has
every sample; a long one the lowest and highest value of every stretch, with half of the
stretches near contacts.
"""

import base64
import re
import zlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vftcli.free_motion.free_motion import within
from vftcli.outputs import Record
from vftcli.outputs.charts import GAP_STEPS, REFERENCE, Chart, ChartLine, paint
from vftcli.signals.arrays import Array, gaps_of

#: Samples kept whole; stretches of two values of longer logs.
WHOLE, STRETCHES = 8192, 4096
COARSE = 4  #: Stretches in one value of a line hidden at first.
AROUND = 0.5  #: Time of short stretches before and after a contact. [s]
#: Unit → largest step of a value: below every band; 2e-4 rad are 0.3 mm.
LARGEST = {"N·m": 0.01, "N": 0.1, "rad": 2e-4}
FEWEST = 1000  #: Least steps between zero and the largest value.
MOST, UNKNOWN = 32767, -32768  #: Largest number of steps; number for NaN.
TICK, WIDE = 1e-4, 32768  #: Step of times [s]; steps in one of the upper row.


class Blob:
    """Rows of numbers for the page's script."""

    def __init__(self) -> None:
        self.steps: list[float] = []  #: Step of each row, in its unit.
        self.rows: list[np.ndarray[Any, np.dtype[np.int16]]] = []  #: The rows in steps.

    def add(self, values: Array, step: float) -> int:
        """Number of a new row; its step grows where values do not fit."""
        step = max(step, largest(values) / MOST) or 1.0
        steps = np.where(np.isfinite(values), np.rint(values / step), UNKNOWN)
        self.rows.append(steps.astype(np.int16))
        self.steps.append(step)
        return len(self.rows) - 1

    def data(self) -> Record:
        """The packed data: high bytes of differences, then low ones."""
        changes = [np.diff(row, prepend=np.int16(0)) for row in self.rows]
        joined = np.concatenate(changes or [np.empty(0, np.int16)])
        # Zigzag: small changes of either sign are small numbers.
        words = ((joined << 1) ^ (joined >> 15)).astype("<i2")
        planes = words.view(np.uint8).reshape(-1, 2).T[::-1].tobytes()
        packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
        packed = packer.compress(planes) + packer.flush()
        sizes = [len(row) for row in self.rows]
        return {"blob": base64.b64encode(packed).decode(), "steps": self.steps, "sizes": sizes}


class PageClock:
    """The samples or stretches of a log that its lines share."""

    def __init__(self, blob: Blob, t: Array, spans: Sequence[tuple[float, float]] = ()) -> None:
        gaps, first, half = gaps_of(t, GAP_STEPS) + 1, np.arange(len(t)), np.array(0)
        self.blob, self.t, self.whole = blob, t, len(t) <= WHOLE
        if not self.whole:
            # Half of the stretches are near spans; none crosses a gap.
            near = within(t, [(start - AROUND, stop + AROUND) for start, stop in spans])
            share, weight = near.mean(), np.ones(len(t))
            if 0 < share < 1:
                weight = np.where(near, 0.5 / share, 0.5 / (1.0 - share))
            ends = np.cumsum(weight)
            even = np.arange(STRETCHES) * (ends[-1] / STRETCHES)
            first = np.unique(np.concatenate([[0], np.searchsorted(ends, even, "right"), gaps]))
            half = np.diff(first, append=len(t)) // 2
        self.starts = first  #: First sample of each stretch, or every sample. (N,)
        self.samples = first + half  #: A sample of each. (N,)
        ticks = np.diff(np.rint(t[self.samples] / TICK).astype(np.int64), prepend=0)
        # Two rows hold 29 bits: a log may have a gap of an hour.
        low, high = ticks % WIDE, ticks // WIDE
        self.rows = [blob.add(low * TICK, TICK), blob.add(high * (WIDE * TICK), WIDE * TICK)]
        self.gaps = np.searchsorted(first, gaps).tolist()

    def index(self, time: float) -> int:
        """Place of the sample nearest to a time on this clock. [s]"""
        sample = np.argmin(np.abs(self.t - time))
        return int(np.searchsorted(self.starts, sample, side="right")) - 1

    def pose(self, values: Array) -> int:
        """Row of one value a stretch: a joint's position. (T,) [rad]"""
        return self.blob.add(values[self.samples], LARGEST["rad"])

    def ends(self, values: Array, unit: str, every: int = 1) -> tuple[int, int | None]:
        """Rows of each stretch's lowest value, and the highest above. (T,)"""
        step, add = step_of(values, unit), self.blob.add
        if self.whole:
            return add(values, step), None
        low, high = (f.reduceat(values, self.starts[::every]) for f in (np.fmin, np.fmax))
        return add(low, step), add(high - low, step)

    def line(self, chart: Chart, line: ChartLine) -> Record:
        """A line of a chart, panel by panel."""
        every = 1 if line.shown or self.whole else COARSE
        columns = zip(line.values.T, chart.units, strict=True)
        lows, spreads = zip(*(self.ends(x, unit, every) for x, unit in columns), strict=True)
        name = re.sub('[",\\s]+', " ", line.name)  # in the head of a CSV
        data: Record = {
            **{key: getattr(line, key) for key in ("name", "leads", "shown")},
            "colour": paint(line.colour),
            "broad": line.colour == REFERENCE,
            "dash": [float(part) for part in line.dash.split()],
            "quiet": line.quiet is not None,
            "every": every,
            "low": lows,
            "columns": [("low", name if self.whole else f"{name} min")],
        }
        if not self.whole:
            data["spread"] = spreads
            data["columns"].append(("high", f"{name} max"))
        if line.half is not None and line.shown:
            # The largest of each stretch.
            data["half"] = [
                self.blob.add(np.fmax.reduceat(half, self.starts), step_of(half, unit))
                for half, unit in zip(line.half.T, chart.units, strict=True)
            ]
            data["columns"].append(("half", f"{name} ±"))
        return data


def step_of(values: Array, unit: str) -> float:
    """Step of a series: its unit's, less for small values."""
    return min(LARGEST.get(unit, 0.0), largest(values) / FEWEST)


def largest(values: Array) -> float:
    """The largest size of a known value."""
    return float(np.max(np.abs(values), where=np.isfinite(values), initial=0.0))


def page_data(
    charts: Sequence[Chart], stage: Callable[[PageClock], Record] | None = None
) -> Record:
    """The script's data: charts over time, each with its clock."""
    blob, clocks, drawn = Blob(), dict[int, PageClock](), []
    for chart in charts:
        # Charts of one log share its array of times.
        if id(chart.x) not in clocks:
            clocks[id(chart.x)] = PageClock(blob, chart.x, chart.spans)
        clock, band = clocks[id(chart.x)], chart.band
        drawn.append(
            {
                **{
                    key: getattr(chart, key)
                    for key in ("key", "title", "panels", "units", "spans")
                },
                "clock": list(clocks).index(id(chart.x)),
                "ends": [tuple(chart.ends(j)) for j in range(len(chart.panels))],
                # JSON has no NaN.
                "band": band if band is None else np.nan_to_num(band).tolist(),
                "lines": [clock.line(chart, line) for line in chart.series],
            }
        )
    data: Record = {"charts": drawn}
    if stage is not None:
        data["stage"] = stage(next(iter(clocks.values())))
    data["clocks"] = [{"t": clock.rows, "gaps": clock.gaps} for clock in clocks.values()]
    return {**data, **blob.data()}
