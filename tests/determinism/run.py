"""The same command gives the same bytes: twice, and whatever hashes, threads, zone and language.

Every command runs in five surroundings, on its own copy of the same logs; what it writes and prints
is compared byte by byte::

    python tests/determinism/run.py

Two things cannot be equal: Rerun numbers what it writes by the clock, so that recordings are
compared by identity and content, and `run.json` without their digests.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
FIXTURES = ROOT / "fixtures"

PROGRAM = "import sys; sys.argv[0] = 'vftcli'; from vftcli.cli import launch; launch()"

SURROUNDINGS = {
    "plain": {},
    "again": {},
    "hashes": {"PYTHONHASHSEED": "12345"},
    "threads": {f"{name}_NUM_THREADS": "4" for name in ("OPENBLAS", "OMP", "MKL")}
    | {"POLARS_MAX_THREADS": "4"},
    "elsewhere": {"TZ": "Asia/Kathmandu", "LC_ALL": "C", "COLUMNS": "40"},
}
"""Name → what is set in the environment."""

COMMANDS = {
    "report": "report a.csv --robot ur5 --reference zero --wrench --anyway -o out",
    "report-two": "report a.csv b.csv --robot ur5 --reference zero --anyway -o out",
    "report-json": "report a.csv --robot ur5 --json --anyway -o out",
    "estimate": "estimate a.csv --robot ur5 --csv --mcap --rrd --wrench --anyway -o out",
    "estimate-panda": "estimate panda.csv --robot panda --observer rts-auto --anyway -o out",
    "estimate-json": "estimate a.csv --robot ur5 --json --anyway -o out",
    "convert-parquet": "convert a.csv -o a.parquet",
    "convert-csv": "convert panda.csv -o p.csv",
    "convert-mcap": "convert a.csv -o a.mcap --json",
    "identify": "identify a.csv --robot ur5 --anyway -o arm.toml",
    "gains": "identify a.csv --method gains --robot ur5 --free 0:2 --anyway -o gains.toml",
    "admit": "admit a.csv --robot ur5 --alpha 1,1.6 --anyway -o out",
    "admit-release": "admit --release x=0.3 --robot ur5 --json -o out",
    "simulate-rtde": "simulate ur5-circle --set duration=1 --seed 2 -o log.csv",
    "simulate-bag": "simulate panda-bearing --set duration=1 --as rosbag2 -o bag",
    "simulate-libfranka": "simulate panda-bearing --set duration=1 -o log.csv --json",
    "simulate-parquet": "simulate ur5-circle --set duration=1 --as parquet -o log.parquet",
    "compare": "compare a.csv b.csv --robot ur5 --reference zero --anyway",
    "compare-json": "compare a.csv --robot ur5 --reference zero --json --significance --anyway",
    "compare-latex": "compare panda.csv --robot panda --reference vendor --latex --anyway",
    "inspect": "inspect a.csv --robot ur5",
    "inspect-json": "inspect panda.csv --json",
    "listings": "robots ur5",
}
"""Name → the command, run in a folder with a.csv, b.csv and panda.csv."""


def logs(folder: Path) -> None:
    """Put short logs into a folder."""
    starts = (("a", "ur5_circle", 0), ("b", "ur5_circle", 300), ("panda", "panda_bearing", 0))
    for name, fixture, first in starts:
        text = (FIXTURES / f"{fixture}.csv").read_text(encoding="utf-8")
        head, *rows = text.splitlines(keepends=True)
        (folder / f"{name}.csv").write_text("".join([head, *rows[first : first + 500]]))


def run(words: Sequence[str], folder: Path, setting: dict[str, str]) -> dict[str, bytes]:
    """Run a command in a folder; name → content of what it wrote and printed."""
    folder.mkdir()
    logs(folder)
    given = set(folder.iterdir())
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"} | setting
    command = [sys.executable, "-c", PROGRAM, *words]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(words)}: {done.stderr.decode()}")
    files = [path for path in folder.rglob("*") if path.is_file() and path not in given]
    found = {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
    return found | {"(stdout)": done.stdout, "(stderr)": done.stderr}


def comparable(name: str, content: bytes) -> bytes:
    """A content without what cannot be equal: digests of recordings, and where a screen folds."""
    if name == "(stdout)":
        return b" ".join(content.split())
    if not name.endswith("run.json"):
        return content
    record = json.loads(content)
    for file in [file for file in record["files"] if file.endswith((".rrd", "run.json"))]:
        del record["files"][file]
    return json.dumps(record).encode()


def recorded(path: Path) -> list[object]:
    """What a recording is called, then all that it holds, without Rerun's numbers of rows.

    In an order of its own: Rerun writes chunks as its threads end, and reads them by time and row.
    `rerun rrd compare` says the same, but that an unknown value differs from itself.
    """
    import pyarrow as pa
    import rerun.chunk

    reader = rerun.chunk.RrdReader(str(path))
    names_of = [str(store.recording_id) for store in reader.recordings()]
    found: list[tuple[str, bytes]] = []
    for chunk in reader.stream():
        batch = chunk.to_record_batch()
        names = [name for name in batch.schema.names if not name.endswith("RowId")]
        plain = pa.record_batch([batch.column(name) for name in names], names=names)
        found.append((chunk.entity_path, plain.serialize().to_pybytes()))
    return [*names_of, *sorted(found)]


def main() -> None:
    """Run all commands in all surroundings; exit 1 if anything differs."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="*", default=list(COMMANDS), choices=list(COMMANDS))
    asked = parser.parse_args()
    equal = total = recordings = 0
    differ = []
    with tempfile.TemporaryDirectory() as place:
        for name in asked.only:
            words, folder = COMMANDS[name].split(), Path(place) / name
            folder.mkdir()
            made = {k: run(words, folder / k, s) for k, s in SURROUNDINGS.items()}
            first = made["plain"]
            for file in sorted(set().union(*made.values())):
                total += 1
                contents = [found.get(file) for found in made.values()]
                if file.endswith(".rrd"):
                    known = [recorded(folder / k / file) for k in SURROUNDINGS]
                else:
                    known = [c if c is None else comparable(file, c) for c in contents]
                fine = all(content == known[0] for content in known)
                recordings += fine and file.endswith(".rrd")
                equal += fine and not file.endswith(".rrd")
                if not fine:
                    differ.append(f"{name}: {file}")
            print(f"{name}: {len(first)} outputs", flush=True)
    print(f"{equal} of {total} outputs have equal bytes, {recordings} recordings equal content")
    print("\n".join(differ))
    sys.exit(bool(differ))


if __name__ == "__main__":
    main()
