"""What users see of the fixtures, kept and made again, by the command line alone.

    python tests/golden/run.py make                              keep what is not kept yet
    python tests/golden/run.py check [--only REGEX] [--rtol R]   make it again; exit 1 if any moved
    python tests/golden/run.py accept --only REGEX --why TEXT    keep what moved, and the reason

An item is LOG/NAME. Kept are exit codes, numbers, codes, words, lines, and of every column of its
Parquet files the rms, ramp-weighted mean and largest of all rows and 30 of them (less than 3 MB in
all); left out are sentences of JSON, so that they can be reworded, paths, versions and hashes.
Fixtures lie in tests/golden/fixtures; real logs, where VFT_LOGS is set, in .golden/ (not in git).
"""

import argparse
import difflib
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent

Leaves = defaultdict[str, list[Any]]
"""Place in the output → its values in order, as `contacts.json contacts[].kind`."""

FIXTURES = """
ur5_circle: fixtures/ur5_circle.csv --robot ur5
ur5_table1: fixtures/ur5_table1.csv --robot ur5
ur5_sensor: fixtures/ur5_sensor.parquet --robot ur5
panda_bearing: fixtures/panda_bearing.csv --robot panda
panda_bag: fixtures/panda_bag --robot panda
"""
"""Name: log and options, which are LOG below."""
UR10E = "--columns t,q:6,dq:6,current:6,target_current:6,target_torque:6 --robot ur10e"
BULLET = "--columns t=t,q=q{i},dq=dq{i},-tau=tau{i},-tau_ext=tau_ext{i} --robot ur5"
REAL = f"""
ur10e_free: logs/ur10e/free_14harm.csv {UR10E}
ur10e_load: logs/ur10e/load_14harm.csv {UR10E}
ur10e_push: logs/ur10e/push_pose.csv {UR10E}
ur10_link4: logs/ur10_link4/link4.csv.gz --columns t,q:6,dq:6,current:6,_:6 --robot ur10e
ur3: logs/ur3/repeat_a.bag --columns=-tau --robot ur3
bullet: logs/bullet_ur5/pushed_7_const.csv.gz {BULLET}
franka_bag: logs/franka_bags/calib_0108.bag --robot fr3
fr3: logs/fr3/run_a.npy --columns t[ns],q:7,dq:7,tau:7,-tau_ext:7,_:13 --robot fr3
mujoco: logs/mujoco_ur5e/circle.csv --robot logs/mujoco_ur5e/robot.toml
"""
BACK = " && ".join(
    f"convert out.parquet -o out.{form} && convert out.{form} -o back_{form}.parquet"
    for form in ("mcap", "csv")
)
MORE = f"""
ur5_circle/compare two-cycle: compare LOG --reference two-cycle --json
ur5_circle/compare zero: compare LOG --reference zero --interval 0:4 --gains paper --json
ur5_circle/compare truth: compare LOG --reference file:fixtures/ur5_circle.csv.truth.parquet --json
ur5_circle/estimate smoother: estimate LOG --observer kfo-rts --wrench --frame base -o out -q
ur5_circle/admit: admit LOG --json
ur5_circle/gains: identify LOG --method gains --interval 0:12 -o out.toml -q
ur5_circle/report: report LOG --reference two-cycle --wrench -o out -q
ur5_circle/convert: convert fixtures/ur5_circle.csv -o out.parquet && {BACK}
ur5_circle/screen inspect: inspect LOG
ur5_circle/screen contacts: contacts LOG
ur5_circle/screen compare: compare LOG --reference two-cycle
ur5_circle/screen estimate: estimate LOG --wrench -o out
ur5_table1/compare two-cycle: compare LOG --reference two-cycle --gains paper --json
ur5_table1/identify: identify LOG --method friction -o out.toml -q
ur5_sensor/compare sensor: compare LOG --reference sensor --wrench --frame base --json
panda_bearing/compare vendor: compare LOG --reference vendor --json
panda_bag/compare vendor: compare LOG --reference vendor --gains auto --json
panda_bag/convert: convert fixtures/panda_bag -o out.parquet && {BACK}
no_log/admit release: admit --release x=0.3 --robot ur5 --alpha 1,1.3,1.6 --json
no_log/simulate circle: simulate ur5-circle --seed 2 --set duration=8 --as parquet -o out.parquet
no_log/simulate table1: simulate ur5-table1 --seed 5 --set duration=8 --as parquet -o out.parquet
no_log/simulate panda: simulate panda-bearing --seed 5 --set duration=4 --as parquet -o out.parquet
refused/no file: inspect nothing.csv
refused/no such robot: contacts fixtures/ur5_circle.csv --robot nobody
refused/another robot: contacts fixtures/ur5_circle.csv --robot panda
refused/no sensor: compare fixtures/ur5_circle.csv --robot ur5 --reference sensor
"""
"""LOG/NAME: commands, besides inspect, contacts and estimate of every log."""
MORE_REAL = """
ur10e_free/thresholds: thresholds LOG --json
ur10e_free/identify: identify LOG --method base -o out.toml -q
ur10e_load/compare: compare LOG --free logs/ur10e/free_14harm.csv --reference two-cycle --json
ur10e_push/contacts free: contacts LOG --free logs/ur10e/free_14harm.csv --json
ur10e_push/screen contacts: contacts LOG
bullet/compare vendor: compare LOG --free 0:8 --reference vendor --gains auto --json
mujoco/compare vendor: compare LOG --reference vendor --json
"""
LEFT_OUT = re.compile("command|versions|sha256|path|files?|message|evidence|consequence|remedy")
SENTENCE, ROWS = 5, 30  # so many words are one; so many rows of a column
DIGITS = 12  # kept of a number: a thousandth of the usual --rtol
ROUNDING = 1e-12  # of sums of some thousand terms of order 1; another processor rounds otherwise
SETTINGS = {"OPENBLAS_NUM_THREADS": "1", "POLARS_MAX_THREADS": "1", "PYTHONPATH": str(ROOT)} | {
    "COLUMNS": "100", "TERM": "dumb", "NO_COLOR": "1", "LC_ALL": "C.UTF-8", "TZ": "UTC"
}  # fmt: skip


def items(logs: str, more: str, folder: Path) -> dict[Path, str]:
    """Where an item is kept → its commands."""
    named = dict(line.split(": ", 1) for line in logs.split("\n")[1:-1])
    every = ("inspect LOG --json", "contacts LOG --json", "estimate LOG -o out -q")
    found = {f"{log}/{line.split()[0]}": line for log in named for line in every}
    found |= dict(line.split(": ", 1) for line in more.split("\n")[1:-1])
    return {
        folder / f"{key.replace(' ', '_')}.json": line.replace(
            "LOG", named.get(key.split("/")[0], "")
        )
        for key, line in found.items()
    }


def add_tree(tree: Any, place: str, found: Leaves) -> None:
    """Add the numbers, words and codes of a JSON tree, and the length of each list."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            if not LEFT_OUT.fullmatch(key):
                add_tree(value, f"{place}.{key}".replace(" .", " "), found)
    elif isinstance(tree, list):
        found[f"{place}[] count"].append(len(tree))
        for value in tree:
            add_tree(value, f"{place}[]", found)
    elif not isinstance(tree, str) or len(tree.split()) < SENTENCE:
        found[place].append(float(f"{tree:.{DIGITS}g}") if isinstance(tree, float) else tree)


def add_columns(file: Path, place: str, found: Leaves) -> None:
    """Add of each column of a Parquet file its size, what all of it amounts to, and some rows."""
    for column in pl.read_parquet(file):
        flat = column.explode() if isinstance(column.dtype, pl.List | pl.Array) else column
        name = f"{place}{column.name}"
        found[f"{name} rows, empty ones"] = [len(flat), flat.null_count()]
        if len(flat) and (flat.dtype.is_numeric() or flat.dtype == pl.Boolean):
            x = flat.cast(pl.Float64).fill_null(np.nan).to_numpy()
            y = np.where(np.isfinite(x), x, 0.0)
            whole = np.sqrt(np.mean(y**2)), np.mean(np.linspace(0, 1, len(y)) * y), abs(y).max()
            some = x[np.linspace(0, len(x) - 1, min(ROWS, len(x))).astype(int)]
            found[name] = [float(f"{value:.{DIGITS}g}") for value in (*whole, *some)]


def lines(text: str) -> list[str]:
    """The lines of a screen or a page, without what differs from run to run."""
    text = re.sub(r"<(script|style|svg|head)\b.*?</\1>|<[^>]+>", "\n", text, flags=re.DOTALL)
    text = re.sub(r"\b[0-9a-f]{12,}\b", "HASH", re.sub(r"\b\d+\.\d+\.\d+\b", "VERSION", text))
    text = re.sub(r"\b20\d\d-\d\d-\d\d(T\S+)?", "DATE", text)
    return [" ".join(line.split()) for line in text.splitlines() if line.strip()]


def seen(commands: str) -> Leaves:
    """What the commands of an item print and write, in a folder of their own."""
    found = Leaves(list)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "fixtures").symlink_to(ROOT / "fixtures")
        (folder / "logs").symlink_to(os.environ.get("VFT_LOGS", HERE))  # asked for if it is set
        for number, command in enumerate(filter(None, commands.split(" && ")), 1):
            done = subprocess.run(
                [sys.executable, "-m", "vftcli", *shlex.split(command)], cwd=folder,
                env=os.environ | SETTINGS, stdin=subprocess.DEVNULL, capture_output=True,
                encoding="utf-8", timeout=240, check=False,  # [s]; the longest takes 10 s
            )  # fmt: skip
            found[f"{number}: exit"].append(done.returncode)
            if "--json" in command and done.returncode == 0:
                add_tree(json.loads(done.stdout), f"{number}: ", found)
            else:
                for way in ("stdout", "stderr"):
                    found[f"{number}: {way}"] = lines(getattr(done, way))
        for file in sorted(Path(top) / f for top, _, files in os.walk(folder) for f in files):
            place = f"{file.relative_to(folder)} "
            found[f"{place}written"] = [True]
            if file.suffix == ".parquet":
                add_columns(file, place, found)
            elif file.suffix in {".html", ".md"}:
                found[f"{place}lines"] = lines(file.read_text("utf-8"))
            elif file.suffix in {".json", ".toml"}:
                read = json.loads if file.suffix == ".json" else tomllib.loads
                add_tree(read(file.read_text("utf-8")), place, found)
    return found


def moves(old: Leaves, new: Leaves, rtol: float) -> list[str]:
    """A line for every place that is gone, new, or moved by more than `rtol` of its largest.

    A column of a Parquet file that moved by less than `ROUNDING` is where it was.
    """
    lost = [f"{p}: gone" for p in old if p not in new] + [
        f"{p}: new" for p in new if p not in old
    ]
    least = {p: ROUNDING * (".parquet " in p) for p in old}
    both = {p: difference(old[p], new[p], rtol, least[p]) for p in old if p in new}
    return lost + [f"{place}: {how}" for place, how in both.items() if how]


def difference(old: list[Any], new: list[Any], rtol: float, least: float) -> str:
    """What moved between the values of one place, empty if nothing did; whole numbers are exact."""
    if len(old) != len(new):
        changed = list(difflib.unified_diff([*map(str, old)], [*map(str, new)], n=0))[2:]
        changed = [line for line in changed if line[:2] != "@@"]
        return f"{len(old)} → {len(new)} values: {' | '.join(changed[:6])}"
    largest = max((abs(x) for x in old if isinstance(x, float) and np.isfinite(x)), default=0)
    room = max(rtol * largest, least)
    bad = [
        f"{x} → {y}"
        for x, y in zip(old, new, strict=True)
        if repr(x) != repr(y) and not (type(x) is type(y) is float and abs(x - y) <= room)
    ]
    return f"{bad[0]}, {len(bad)} of {len(old)} values" if bad else ""


def main() -> int:
    """1 if anything moved, else 0."""
    parser = argparse.ArgumentParser(description="What users see, kept and made again.")
    parser.add_argument("do", choices=("make", "check", "accept"))
    parser.add_argument("--only", default="", metavar="REGEX")
    parser.add_argument("--rtol", type=float, default=1e-9)
    parser.add_argument("--why", default="")
    given = parser.parse_args()
    if given.do == "accept" and not (given.only and given.why):
        parser.error("accept needs --only REGEX and --why TEXT")
    listed = dict.fromkeys((HERE / "fixtures").rglob("*.json"), "")
    listed |= items(FIXTURES, MORE, HERE / "fixtures")
    if "VFT_LOGS" in os.environ:
        listed |= items(REAL, MORE_REAL, ROOT / ".golden")
    listed = {
        k: v for k, v in listed.items() if re.search(given.only, f"{k.parent.name}/{k.stem}")
    }
    chosen = {k: v for k, v in listed.items() if k.exists() == (given.do != "make")}
    changed = []
    with ThreadPoolExecutor(2) as pool:
        for path, found in zip(chosen, pool.map(seen, chosen.values()), strict=True):
            text = path.read_text("utf-8") if path.exists() else "{}"
            if how := moves(json.loads(text), found, given.rtol):
                changed.append(
                    f"{path.parent.name}/{path.stem}: {len(how)}, {'; '.join(how[:3])}"
                )
                print(changed[-1], flush=True)
                if given.do == "accept" and not found:
                    path.unlink()  # no longer listed
                elif given.do != "check":
                    path.parent.mkdir(parents=True, exist_ok=True)
                    texts = [f"{json.dumps(k)}: {json.dumps(v)}" for k, v in found.items()]
                    path.write_text("{\n" + ",\n".join(texts) + "\n}\n", encoding="utf-8")
    if given.do == "accept" and changed:
        with (HERE / "changes.md").open("a", encoding="utf-8") as reasons:
            reasons.write("\n  - ".join([f"- {given.why}", *changed]) + "\n")
    done, rest = ("kept", "kept before") if given.do == "make" else ("moved", "not kept yet")
    print(
        f"golden: {len(chosen)} items, {len(changed)} {done}, {len(listed) - len(chosen)} {rest}"
    )
    return int(given.do == "check" and (bool(changed) or not chosen))


if __name__ == "__main__":
    sys.exit(main())
