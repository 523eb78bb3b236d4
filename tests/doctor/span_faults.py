"""Bad samples, bad spans and bad drives through the whole way: what is said, and what it costs.

Run by hand; some five minutes for all, seconds for a few::

    VFT_LOGS=/path/to/logs python tests/doctor/span_faults.py
    python tests/doctor/span_faults.py --only "one sample" --only brakes --log ur10e

A cell is one fault in one log, given to `report` without an output, with the observers gmo and
best. It is refused, warned (a warning that the sound log does not have), noted (a caution that it
does not have, or a note of reader or doctor) or silent; whether a gain ran to its limit counts for
nothing. It is harmful where gmo moves by more than 0.25 N·m or best by more than 0.6 N·m, the mean
over joints of the rms over the samples that both logs have, or where a joint of either vanishes:
HARM where that is silent or noted. A line says what gmo and best move by, the share of the rows
that differ from the sound log's (`!` where so few are refused), and the new codes.
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from planted_faults import Maker, Table
from planted_spans import OF_FREE_MOTION, SOURCES, SpanLog, span_faults, span_log

from vftcli.analysis import Analysis
from vftcli.notebook import report, thresholds
from vftcli.signals.arrays import Array
from vftcli.signals.errors import VftError
from vftcli.signals.remarks import Remark

HARM = {"gmo": 0.25, "best": 0.6, "thresholds": 0.6}
"""What an estimate moves by where a fault is harmful. [N·m]"""

OF_TUNING = "gain-at-"
"""How codes of warnings begin that come and go with the noise and name nothing that is wrong."""

FEW = 0.05
"""Share of bad rows below which a log must be cut and never refused."""

BROKEN = "BROKEN"
"""How the words begin of a cell that ends in a traceback."""

BARS = {"silent and harmful": 0.12, "refused": 0.45}
"""Largest shares of the cells."""


class Answer(NamedTuple):
    """What comes of a log."""

    t: Array = np.zeros(0)  # in the sound log's time (T,) [s]
    torques: Mapping[str, Array] = {}  # by observer; of thresholds one row (T, n) each [N·m]
    said: frozenset[tuple[str, str, tuple[int, ...]]] = frozenset()  # level, code, joints
    refused: str = ""  # why there is nothing else


def answer(table: Table, path: Path, learns: bool = False) -> Answer:
    """What `report` says of a table once it is a file, `thresholds` where it learns from it."""
    table.write(path)
    try:
        if learns:
            found = thresholds(path, table.given)
            level = np.array([[one.value for one in found.joints]])
            return Answer(np.zeros(1), {"thresholds": level}, kinds(found.remarks))
        return of_report(report(path, table.given, observer=("gmo", "best")), table)
    except VftError as error:
        return Answer(refused=str(error).removeprefix(f"{path.name}: "))
    except Exception as error:  # noqa: BLE001 - a cell that breaks is a result
        return Answer(refused=f"{BROKEN} {type(error).__name__}: {error}")
    finally:
        path.unlink()


def of_report(made: Analysis, table: Table) -> Answer:
    """The estimates of an analysis, at the sound log's times."""
    t = table.sound_t
    if len(made.t) != len(t):  # rows were left out; the others keep their stamps
        t = t[nearest(table.t, made.recording.source.t0 + made.t)]
    findings = [finding for one in made.examinations for finding in one.findings]
    doubts = [remark for remark in made.remarks if remark.level != "fact"]
    said = kinds((*findings, *made.recording.source.remarks, *doubts))
    return Answer(t, {one.name: one.tau for one in made.estimates}, said)


def nearest(grid: Array, values: Array) -> Array:
    """Index of the grid's point that is nearest to each value."""
    right = np.clip(np.searchsorted(grid, values), 1, len(grid) - 1)
    return right - (values - grid[right - 1] < grid[right] - values)


def kinds(remarks: Iterable[Remark]) -> frozenset[tuple[str, str, tuple[int, ...]]]:
    """Level, code and joints of each remark but those of the tuning."""
    codes = [remark for remark in remarks if not remark.code.startswith(OF_TUNING)]
    return frozenset((remark.level, remark.code, remark.where.joints) for remark in codes)


class Cell(NamedTuple):
    """One fault in one log."""

    log: str
    fault: str
    verdict: str
    harmful: bool  # an estimate moves or vanishes; False where the log is refused
    moved: dict[str, float]  # by observer [N·m]
    vanished: list[str]  # joints that are nowhere known though the sound log's are
    codes: list[str]  # new warnings, else new notes; or why it is refused
    bad: float  # share of the rows

    @property
    def counts_against(self) -> bool:
        return self.harmful and self.verdict in {"silent", "noted"}

    @property
    def refused_for_few(self) -> bool:
        return self.verdict == "refused" and 0 < self.bad < FEW

    def __str__(self) -> str:
        moved = " ".join(f"{self.moved[n]:8.3g}" for n in HARM if n in self.moved).rjust(17)
        harm = "HARM" if self.counts_against else "harm" if self.harmful else ""
        gone = "".join(f"{word} vanishes " for word in self.vanished)
        return (
            f"{self.fault:32} {self.log:9} {self.verdict:7}{'!' * self.refused_for_few:1} "
            f"{harm:4} {moved} {100 * self.bad:5.1f} %  {gone}{' '.join(self.codes)[:150]}"
        )


def cell(log: str, name: str, fault: Maker, base: SpanLog, sound: Answer, path: Path) -> Cell:
    """Plant a fault and judge what comes of it."""
    table = fault(base.table)
    made = answer(table, path, name in OF_FREE_MOTION)
    new = sorted(made.said - sound.said)
    warned = [shown(code, joints) for level, code, joints in new if level == "warning"]
    noted = [shown(code, joints) for level, code, joints in new if level != "warning"]
    verdict = (
        "refused" if made.refused else "warned" if warned else "noted" if noted else "silent"
    )
    moved, vanished = moves(made, sound)
    harmful = any(moved[n] > HARM[n] for n in moved) or bool(vanished)
    codes = [made.refused] if made.refused else warned or noted
    bad = bad_share(table, base.table)
    return Cell(log, name, verdict, harmful, moved, vanished, codes, bad)


def shown(code: str, joints: tuple[int, ...]) -> str:
    return code + (f"[{','.join(f'J{j}' for j in joints)}]" if joints else "")


def moves(made: Answer, sound: Answer) -> tuple[dict[str, float], list[str]]:
    """What each estimate moves by [N·m], mean over joints of the rms, and joints that vanish."""
    if made.refused:
        return {}, []
    _, rows, known = np.intersect1d(made.t, sound.t, return_indices=True)
    moved, vanished = {}, []
    for name, before in sound.torques.items():
        if name not in made.torques:
            vanished.append(name)
            continue
        difference = made.torques[name][rows] - before[known]
        there = np.isfinite(difference)
        was = np.isfinite(before).any(axis=0)
        vanished += [f"{name} J{j + 1}" for j in np.flatnonzero(was & ~there.any(axis=0))]
        seen = there.any(axis=0)
        rms = np.sqrt(np.nanmean(difference[:, seen] ** 2, axis=0))
        moved[name] = float(np.mean(rms)) if seen.any() else np.inf
    return moved, vanished


def bad_share(table: Table, sound: Table) -> float:
    """Share of a table's rows whose values or step of time differ from the sound log's."""
    rows = np.searchsorted(
        sound.t, np.where(np.isfinite(table.sound_t), table.sound_t, sound.t[0])
    )
    bad = ~np.isfinite(table.sound_t)
    for (_, made), (_, good) in zip(table.series(), sound.series(), strict=True):
        bad |= (made != good[rows]).any(axis=1)
    jumps = np.abs(np.diff(table.t - table.sound_t, prepend=table.t[0] - table.sound_t[0])) > 1e-3
    return float(np.mean(bad | jumps))


def sums(cells: Sequence[Cell]) -> Iterator[str]:
    """What the cells come to, each share beside its bar."""
    refused = [one for one in cells if one.verdict == "refused"]
    against = [one for one in cells if one.counts_against]
    for (name, bar), found in zip(BARS.items(), (against, refused), strict=True):
        share = len(found) / len(cells)
        missed = ", missed" if share > bar else ""
        yield f"{name}: {len(found)} of {len(cells)} cells, {share:.1%} (bar {bar:.0%}{missed})"
    few = [f"{one.fault} in {one.log}" for one in cells if one.refused_for_few]
    yield f"below {FEW:.0%} bad rows refused: {len(few)} {'; '.join(few)}"
    without = [one for one in refused if "--anyway" not in one.codes[0]]
    broken = [one for one in refused if one.codes[0].startswith(BROKEN)]
    yield f"refusals that do not name --anyway: {len(without)}; tracebacks: {len(broken)}"


def main(words: Sequence[str]) -> int:
    """Print the cells and their sums; exit 1 where a bar is missed."""
    parser = argparse.ArgumentParser(description="plant bad samples and spans in sound logs")
    parser.add_argument("--log", action="append", choices=list(SOURCES), help="only this log")
    parser.add_argument("--only", action="append", help="only faults with this in their name")
    choice = parser.parse_args(words)
    cells: list[Cell] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "planted.csv"
        for log in choice.log or SOURCES:
            base = span_log(log, Path(os.environ["VFT_LOGS"]))
            sound = {learns: answer(base.table, path, learns) for learns in {False, base.free}}
            for said in sound.values():
                assert not said.refused, f"the sound log {log} is refused: {said.refused}"
            for name, fault in span_faults(base).items():
                if not choice.only or any(word in name for word in choice.only):
                    known = sound[name in OF_FREE_MOTION]
                    cells.append(cell(log, name, fault, base, known, path))
                    print(cells[-1], flush=True)
    print(*sums(cells), sep="\n")
    return int(any(line.endswith("missed)") for line in sums(cells)))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
