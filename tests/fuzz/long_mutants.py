"""Logs that are long enough for every observer and list, and the commands that work on them."""

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

from container_mutants import dataset_mutant
from text_mutants import table_mutant
from tokens import Mutant, Rng, Seed, pick

sys.path.insert(0, str(Path(__file__).parents[1] / "doctor"))

FIXTURES = Path(__file__).parents[2] / "fixtures"
LOGS = {"ur5": "ur5_circle.csv", "panda": "panda_bearing.csv"}
EPISODES = "panda_episodes"

RATE, SECONDS = 50.0, 12.0
"""Of a seed [Hz, s]: `best` runs on it, and most commands take about a second."""

ENDINGS = {"identify": "out.toml"}
CHOICES: dict[str, dict[str, tuple[str, ...]]] = {
    "report": {
        "--reference": ("zero", "two-cycle", "vendor"), "recording.detail": ("levels", "none"),
    },
    "identify": {"--method": ("friction", "base", "targets", "payload", "gains")},
    "admit": {"admittance.controller": ("variable", "traditional")},
    "contacts": {"--free": ("0:3", "9:12")},
    "thresholds": {"--rate": ("1", "60")},
    "batch": {"--do": ("estimate", "compare", "report", "contacts"), "--jobs": ("0",)},
}  # fmt: skip
"""Command → its options and their values, one of each is drawn."""


def long_seeds(folder: Path) -> Iterator[Seed]:
    """A log of a UR5 and of a Panda, and a dataset of three episodes."""
    from planted_faults import table_from
    from planted_spans import thinned

    from vftcli.readers.reading import read

    for robot, name in LOGS.items():
        table = thinned(table_from(read(FIXTURES / name), robot), RATE).between(0.0, SECONDS)
        path = table.write(folder / f"long-{robot}.csv")
        yield Seed(f"long-{robot}", "long", path, model=table)
    shutil.copytree(FIXTURES / EPISODES, folder / EPISODES)
    yield Seed(EPISODES, "long", folder / EPISODES)


def long_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A table with a planted fault or one thing changed; a dataset with one thing changed."""
    from planted_spans import SpanLog, span_faults

    if seed.model is None:
        return dataset_mutant(seed, rng, path)
    if rng.random() < 0.5:
        return table_mutant(seed, rng, path)
    faults = span_faults(SpanLog(seed.model, seed.model.robot, free=True))
    name = pick(rng, list(faults))
    faults[name](seed.model).write(path)
    return Mutant(name)


def long_words(seed: Seed, place: Path, rng: Rng, folder: Path) -> list[str]:
    if seed.model is None:
        words = ["annotate", str(place), "--robot", "panda", "--jobs", "0"]
    else:
        command = pick(rng, list(CHOICES))
        words = [command, str(place), "--robot", seed.model.robot]
        for option, values in CHOICES[command].items():
            value = pick(rng, values)
            words += [option, value] if option.startswith("-") else ["--set", f"{option}={value}"]
    if words[0] in {"contacts", "thresholds"}:
        words.append("--json")
    else:
        words += ["-o", str(folder / ENDINGS.get(words[0], "out"))]
    return [*words, *(["--anyway"] if rng.random() < 0.7 else [])]
