"""Mutation fuzzing of every reader: python tests/readers/fuzz_readers.py --mutants 20000 --seed 1

Seeds are small logs of every format (seed_logs.py). A mutant has bytes flipped, cut, inserted,
repeated or moved, a count blown up, or its head swapped with another format's. Reading it must
end in a Recording or in a one-line VftError, within 10 s and 1 GiB, and a Recording with another
number of rows than the seed must say why.
"""

import argparse
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from seed_logs import SEEDS

from vftcli.readers import read
from vftcli.signals.errors import VftError
from vftcli.signals.recording import Recording

TIME_LIMIT = 10.0
MEMORY_LIMIT_KB = 1024 * 1024
TEXT = {
    "ur-csv": 1, "ur-rtde": 1, "libfranka-csv": 1, "libfranka-csv-old": 1, "table": 1,
    "headerless": 0,
}  # fmt: skip
"""Text formats and their header lines: their rows can be counted without the reader."""

UR_RECORD = 60
"""Bytes of a record of the binary seed."""

Bytes = bytes
Rng = np.random.Generator


def flip(data: Bytes, rng: Rng) -> Bytes:
    out = bytearray(data)
    for place in rng.integers(0, len(out), rng.integers(1, 9)):
        out[place] ^= 1 << int(rng.integers(8))
    return bytes(out)


def flip_early(data: Bytes, rng: Rng) -> Bytes:
    return flip(data[:512], rng) + data[512:]


def cut(data: Bytes, rng: Rng) -> Bytes:
    return data[: int(rng.integers(1, len(data)))]


def cut_middle(data: Bytes, rng: Rng) -> Bytes:
    a, b = sorted(rng.integers(0, len(data), 2))
    return data[: int(a)] + data[int(b) :]


def insert(data: Bytes, rng: Rng) -> Bytes:
    place = int(rng.integers(len(data)))
    return data[:place] + rng.bytes(int(rng.integers(1, 64))) + data[place:]


def repeat(data: Bytes, rng: Rng) -> Bytes:
    a, b = sorted(rng.integers(0, len(data), 2))
    return data[: int(b)] + data[int(a) :]


def huge_count(data: Bytes, rng: Rng) -> Bytes:
    out = bytearray(data)
    size = int(rng.choice([2, 4, 8]))
    place = int(rng.integers(0, max(1, len(out) - size)))
    value = rng.choice([b"\xff" * size, b"\xff" * (size - 1) + b"\x7f", bytes(size)])
    out[place : place + size] = value
    return bytes(out)


def token(data: Bytes, rng: Rng) -> Bytes:
    """Put something where a number or a name was."""
    tokens = [
        b"nan",
        b"inf",
        b"-",
        b"1e999",
        b"",
        b"\n",
        b"\r",
        b",",
        b" ",
        b'"',
        b"#",
        b"\0",
        b"{",
    ]
    tokens += [b"[" * 2000, b'{"a":' * 500, b"9" * 400, b"\xff\xfe", b"\xef\xbb\xbf"]
    place = int(rng.integers(len(data)))
    gone = int(rng.integers(0, 12))
    return data[:place] + tokens[int(rng.integers(len(tokens)))] + data[place + gone :]


MUTATIONS: tuple[Callable[[Bytes, Rng], Bytes], ...] = (
    flip, flip, flip_early, cut, cut_middle, insert, repeat, huge_count, token, token,
)  # fmt: skip


class Mutant(NamedTuple):
    """One mutated file and what it came from."""

    seed: str
    how: str
    data: Bytes
    columns: str | None


def mutants(folder: Path, count: int, seed: int) -> Iterator[Mutant]:
    """Mutants of all seeds in turn; the same for the same seed."""
    rng = np.random.default_rng(seed)
    originals = {name: make(folder / name).read_bytes() for name, (make, _) in SEEDS.items()}
    names = list(SEEDS)
    for k in range(count):
        name = names[k % len(names)]
        data = originals[name]
        if rng.random() < 0.03:
            other = originals[names[int(rng.integers(len(names)))]]
            half = int(rng.integers(1, min(len(other), 4096)))
            yield Mutant(name, "swap heads", other[:half] + data[half:], SEEDS[name][1])
            continue
        how = []
        for _ in range(int(rng.integers(1, 4))):
            mutation = MUTATIONS[int(rng.integers(len(MUTATIONS)))]
            data = mutation(data, rng) or b"\0"
            how.append(mutation.__name__)
        yield Mutant(name, "+".join(how), data, SEEDS[name][1])


def expected_rows(name: str, data: Bytes, seed_rows: int) -> int:
    """Rows that a file should have: counted in text, the seed's elsewhere."""
    lines = data.replace(b"\r", b"\n").split(b"\n")
    if name == "libfranka-json":
        return sum(line.lstrip().startswith(b"{") for line in lines)
    if name == "ur-binary":  # a cut between two records leaves a file that is whole
        return len(data.split(b"\n", 2)[-1]) // UR_RECORD
    if name not in TEXT:
        return seed_rows
    filled = [line for line in lines if line.strip()]
    return len(filled) - TEXT[name]


def judge(mutant: Mutant, path: Path, seed: Recording) -> str:
    """Read a mutant; the verdict is 'read', 'refused', or what went wrong.

    A Recording must say why it has other rows than expected, unless the mutant is of a format in
    which a cut at a row's end leaves a file that is whole.
    """
    path.write_bytes(mutant.data)
    start = time.perf_counter()
    signal.setitimer(signal.ITIMER_REAL, TIME_LIMIT)
    try:
        recording = read(path, columns=mutant.columns)
    except VftError as error:
        return "refused" if "\n" not in str(error) else "SEVERAL LINES"
    except TimeoutError:
        return "HANG"
    except BaseException:  # noqa: BLE001 - whatever it is, it is what is looked for
        return "TRACEBACK " + traceback.format_exc()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    if time.perf_counter() - start > TIME_LIMIT:
        return "SLOW"
    rows = recording.source.rows
    same_format = recording.source.format == seed.source.format
    wanted = expected_rows(mutant.seed, mutant.data, seed.source.rows)
    said = recording.source.repairs != seed.source.repairs or recording.source.warnings
    if same_format and rows != wanted and not said:
        return f"SILENT {rows} rows for {wanted}"
    return "read"


def interrupted(*_: object) -> None:
    raise TimeoutError


def run(count: int, seed: int, keep: Path | None = None) -> tuple[Counter[str], list[str]]:
    """Fuzz; return how often each verdict was given, and the failures in words."""
    signal.signal(signal.SIGALRM, interrupted)
    verdicts: Counter[str] = Counter()
    failures = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "seeds").mkdir()
        seeds = {
            key: read(make(folder / f"{key}.seed"), columns=columns)
            for key, (make, columns) in SEEDS.items()
        }
        for k, mutant in enumerate(mutants(folder / "seeds", count, seed)):
            before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            verdict = judge(mutant, folder / "mutant", seeds[mutant.seed])
            if resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before > MEMORY_LIMIT_KB:
                verdict = "MEMORY"
            verdicts[f"{mutant.seed}: {verdict.split()[0]}"] += 1
            if verdict not in {"read", "refused"}:
                failures.append(f"mutant {k} of {mutant.seed} ({mutant.how}): {verdict}")
                if keep is not None:
                    (keep / f"{seed}-{k}-{mutant.seed}").write_bytes(mutant.data)
    return verdicts, failures


def main() -> int:
    """Fuzz from the command line; exit 1 if anything failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for the mutants that failed")
    asked = parser.parse_args()
    start = time.perf_counter()
    verdicts, failures = run(asked.mutants, asked.seed, asked.keep)
    lines = [f"{name}: {number}" for name, number in sorted(verdicts.items())]
    lines += failures[:200]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    lines.append(
        f"{asked.mutants} mutants in {time.perf_counter() - start:.0f} s, peak {peak} MiB, "
        f"{len(failures)} failures"
    )
    sys.stdout.write("\n".join(lines) + "\n")
    return 1 if failures else 0


if __name__ == "__main__":
    raise SystemExit(main())
