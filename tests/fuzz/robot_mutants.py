"""Mutations of the files a user writes: robots as TOML, URDF and MJCF, gains, scenarios."""

import re
from pathlib import Path
from xml.etree import ElementTree as ET

from bytes_mutants import bytes_mutant
from tokens import NUMBERS, WORDS, Mutant, Rng, Seed, pick

ASSIGNS = re.compile(r"^\s*([\w\"'.-]+)\s*=\s*(.*?)(\s*#.*)?$")

VALUES = (
    "true", "[]", "{}", "[[]]", "{a = 1}", '""', '"x"', '"1.0"', "nan", "inf", "-inf", "1e308",
    "1e20", "-1", "0", "1e-320", "99999999999999999999", "9" * 5000, "2026-01-02", "03:04:05",
    "[1, 2]", '["a", "b"]', "[nan, nan, nan]", "[0, 0, 0, 0, 0, 0]", "[1e20, 0, 0]", "[" * 3000,
    "[true, 1]", '"\\u0000"', '"<b>"', "0x10", "1_000", "[{a = 1}]", "[[1, 2], [3]]",
    "180.0", "-0.0", "1e5",
)  # fmt: skip


HEADERS = ("[joints]", "[[payload]]", "[payload]", "[observers.gmo]", "[a.b]")
TAGS = ("link", "joint", "mass", "axis", "x", "inertial", "robot", "limit")


def toml_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A TOML file with a value, a key, a line or a table changed."""
    if rng.random() < 0.1:
        return bytes_mutant(seed, rng, path)
    lines = seed.path.read_bytes().decode().split("\n")
    for _ in range(int(pick(rng, (1, 1, 1, 2)))):
        assigning = [k for k, line in enumerate(lines) if ASSIGNS.match(line)]
        headers = [k for k, line in enumerate(lines) if line.startswith("[")]
        kind = int(rng.integers(10))
        k = int(pick(rng, assigning if assigning else [0]))
        match = ASSIGNS.match(lines[k])
        key = match[1] if match else ""
        if kind <= 4:
            lines[k] = f"{key} = {new_value(match[2] if match else '', rng)}"
        elif kind == 5:
            del lines[k]
        elif kind == 6:
            other = ASSIGNS.match(lines[int(pick(rng, assigning))])
            lines[k] = lines[k].replace(key, other[1] if other else "x", 1)
        elif kind == 7:
            lines.insert(int(rng.integers(len(lines))), lines[k])
        elif headers and kind == 8:
            del lines[int(pick(rng, headers))]
        elif headers:
            h = int(pick(rng, headers))
            lines[h] = pick(rng, HEADERS)
    path.write_text("\n".join(lines), encoding="utf-8")
    return Mutant(f"toml {key}")


def new_value(old: str, rng: Rng) -> str:
    """Another value: of another type, or one of its numbers changed."""
    numbers = list(re.finditer(r"-?\d+\.?\d*(e-?\d+)?", old))
    if numbers and rng.random() < 0.6:
        spot = pick(rng, numbers)
        put = pick(rng, NUMBERS) if rng.random() < 0.6 else float(spot[0]) * pick(
            rng, (-1.0, 57.3, 1e3, 1e-3, 0.0, 1e9)
        )  # fmt: skip
        return old[: spot.start()] + repr(put) + old[spot.end() :]
    return pick(rng, VALUES)


def urdf_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A URDF or MJCF with an attribute, an element or names changed."""
    if rng.random() < 0.15:
        return bytes_mutant(seed, rng, path)
    root = ET.fromstring(seed.path.read_bytes())
    parents = [element for element in root.iter() if len(element)]
    element = pick(rng, [e for e in root.iter() if e.attrib])
    key = pick(rng, list(element.attrib))
    kind = int(rng.integers(12))
    if kind <= 2:
        old = element.get(key, "")
        put = pick(rng, WORDS) if rng.random() < 0.5 else str(pick(rng, NUMBERS))
        words = old.split()
        if len(words) > 1 and rng.random() < 0.6:
            words[int(rng.integers(len(words)))] = put
            put = " ".join(words)
        element.set(key, put)
    elif kind == 3:
        del element.attrib[key]
    elif kind == 4:
        parent = pick(rng, parents)
        parent.remove(pick(rng, list(parent)))
    elif kind == 5:
        parent = pick(rng, parents)
        parent.append(pick(rng, list(parent)))
    elif kind == 6:
        element.tag = pick(rng, TAGS)
    elif kind >= 8:
        misname(root, rng, kind - 7)
    else:
        retype(root, rng)
    text = ET.tostring(root, encoding="unicode")
    clean = "".join(c for c in text if c.isprintable() or c in "\n\t")
    path.write_text(clean, encoding="utf-8", errors="replace")
    return Mutant(f"urdf{kind} {element.tag} {key}")


def retype(root: ET.Element, rng: Rng) -> None:
    """Give joints other types."""
    kinds = ("fixed", "prismatic", "floating", "planar", "continuous", "revolute", "screw", "")
    for joint in root.iter("joint"):
        if rng.random() < 0.3:
            joint.set("type", pick(rng, kinds))


def misname(root: ET.Element, rng: Rng, times: int) -> None:
    """Give elements names of others: two of a name, circles, branches, followers of themselves."""
    named = [e for e in root.iter() if {"name", "link", "joint"} & e.attrib.keys()]
    for _ in range(times):
        element, other = pick(rng, named), pick(rng, named)
        own = next(k for k in ("link", "joint", "name") if k in element.attrib)
        theirs = next(k for k in ("name", "link", "joint") if k in other.attrib)
        element.set(own, other.attrib[theirs])
