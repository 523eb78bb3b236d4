"""Mutations of descriptions of robots: URDF and MJCF."""

from pathlib import Path
from xml.etree import ElementTree as ET

from changes import list_changed
from text_mutants import bytes_mutant
from tokens import NUMBERS, WORDS, Mutant, Rng, Seed, pick

TAGS = ("link", "joint", "mass", "axis", "x", "inertial", "robot", "limit")
TYPES = ("fixed", "prismatic", "floating", "planar", "continuous", "revolute", "screw", "")


def urdf_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A URDF or MJCF with an attribute, elements or names changed."""
    if rng.random() < 0.15:
        return bytes_mutant(seed, rng, path)
    root = ET.fromstring(seed.path.read_bytes())
    element = pick(rng, [e for e in root.iter() if e.attrib])
    key = pick(rng, list(element.attrib))
    kind = int(rng.integers(10))
    if kind <= 2:
        words = element.attrib[key].split() or [""]
        list_changed(words, rng, lambda _, rng: str(pick(rng, pick(rng, (WORDS, NUMBERS)))))
        element.set(key, " ".join(words))
    elif kind == 3:
        del element.attrib[key]
    elif kind <= 5:
        parent = pick(rng, [element for element in root.iter() if len(element)])
        inner = list(parent)
        list_changed(inner, rng, lambda _, rng: ET.Element(pick(rng, TAGS)))
        parent[:] = inner
    elif kind == 6:
        element.tag = pick(rng, TAGS)
    elif kind == 7:
        for joint in root.iter("joint"):
            if rng.random() < 0.3:
                joint.set("type", pick(rng, TYPES))
    else:
        misname(root, rng, kind - 7)
    text = ET.tostring(root, encoding="unicode")
    clean = "".join(c for c in text if c.isprintable() or c in "\n\t")
    path.write_text(clean, encoding="utf-8", errors="replace")
    return Mutant(f"urdf{kind} {element.tag} {key}")


def misname(root: ET.Element, rng: Rng, times: int) -> None:
    """Give elements names of others: two of a name, circles, branches, followers of themselves."""
    named = [e for e in root.iter() if {"name", "link", "joint"} & e.attrib.keys()]
    for _ in range(times):
        element, other = pick(rng, named), pick(rng, named)
        own = next(k for k in ("link", "joint", "name") if k in element.attrib)
        theirs = next(k for k in ("name", "link", "joint") if k in other.attrib)
        element.set(own, other.attrib[theirs])
