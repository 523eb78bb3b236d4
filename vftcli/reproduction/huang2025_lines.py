"""Huang et al. 2025: lines that several of its tables and figures share, or that come in sets."""

from vftcli.observers import PAPER
from vftcli.reproduction.control import ALPHAS
from vftcli.reproduction.paper import PrintedLine

#: Observer → what the paper calls it.
NAMES = {"fdo": "FDO", "gmo": "GMO", "kfo-fe": "KFO-FE", "kfo-zoh": "KFO-ZOH"}


def each(
    key: str, label: str, unit: str = "", printed: tuple[str, ...] = ()
) -> tuple[PrintedLine, ...]:
    """A line for every observer; what counts beside the print has no unit."""
    numbers = printed or ("",) * len(PAPER)
    return tuple(
        PrintedLine(f"{key}/{name}", f"{NAMES[name]}: {label}", unit, number, not unit)
        for name, number in zip(PAPER, numbers, strict=True)
    )


def parameters(
    rows: dict[str, tuple[str, ...]], axes: tuple[str, ...] = ("x", "z", "rx")
) -> tuple[PrintedLine, ...]:
    """The lines of Table III or IV: printed numbers of these axes, those of the robot's file."""
    units = {
        "mass": ("kg", "kg·m²"),
        "damping": ("N·s/m", "N·m·s/rad"),
        "stiffness": ("N/m", "N·m/rad"),
        "threshold": ("N", "N·m"),
        "speed_limit": ("m/s", "rad/s"),
    }
    words = {"mass": "M_d", "damping": "B_d", "stiffness": "K_d", "alpha": "α"}
    words |= {"threshold": "F_tsd", "speed_limit": "speed limit", "xi": "ξ"}
    return tuple(
        PrintedLine(
            f"{key}/{axis}",
            f"{words[key]}, {axis}",
            units.get(key, ("", ""))[axis.startswith("r")],
            number,
        )
        for key, numbers in rows.items()
        for axis, number in zip(axes, numbers, strict=True)
    )


def returns(alphas: tuple[str, ...]) -> tuple[PrintedLine, ...]:
    """How a release from rest returns."""
    named = {"traditional": "traditional", **{alpha: f"α {alpha}" for alpha in alphas}}
    return tuple(
        PrintedLine(f"{key}/{name}", f"{words}: {label}", unit)
        for key, words, unit in (
            ("return_10_s", "back to 10 %", "s"),
            ("return_2_s", "back to 2 %", "s"),
            ("overshoot", "overshoot", "%"),
        )
        for name, label in named.items()
    )


def latency_lines(
    reaction: tuple[str, str], stop: tuple[str, str], astray: tuple[str, str]
) -> tuple[PrintedLine, ...]:
    """Latencies of both contacts, and how far the other axes moved meanwhile.

    Args:
        reaction: What is printed of each contact's time from detection to motion. [s]
        stop: And from the force's withdrawal to recovery. [s]
        astray: What the other axes do, and its unit.
    """
    latencies = tuple(
        PrintedLine(
            f"{key}/{k}", f"{words}, phase {'I' * k}", "s", numbers[k - 1] if numbers else ""
        )
        for key, words, numbers in (
            ("reaction", "detection to motion (5 mm, 0.02 rad)", reaction),
            ("stop", "estimate gone to the turn", stop),
            ("detection", "true force over the threshold to detection", ()),
            ("motion", "true force over the threshold to motion", ()),
            ("withdrawal", "true force gone to estimate gone", ()),
        )
        for k in (1, 2)
    )
    return (*latencies, PrintedLine("astray", *astray))


def comparison_lines(advance: str, axis: str) -> tuple[PrintedLine, ...]:
    """Figs. 7 and 10: α against traditional on one force record.

    Args:
        advance: How much earlier α 1.9 peaks in print. [s]
        axis: One of those that are dragged.
    """
    alphas = [f"{alpha:g}" for alpha in ALPHAS]
    lines = [
        PrintedLine(
            f"{key}/{alpha}/{k}",
            f"{words}, α {alpha}, phase {'I' * k}",
            "s",
            number if alpha == "1.9" else "",
            # Dips of the record move the peak of a whole drag: only the turn compares.
            key == "turn",
        )
        for key, words, wanted, number in (
            ("peak", "peak of the whole drag earlier by", ["1.9"], advance),
            ("turn", "turn after the last release earlier by", ["1.6", "1.9"], advance),
            ("back", "back to 10 % after the release", alphas, ""),
        )
        for alpha in wanted
        for k in (1, 2)
    ]
    before = [
        PrintedLine(f"back/traditional/{k}", f"back to 10 %, traditional, phase {'I' * k}", "s")
        for k in (1, 2)
    ]
    bounds = [
        PrintedLine(f"latest/{axis}", "turn after a release, traditional, at the latest", "s"),
        PrintedLine(f"most/{axis}/1.9", "turn earlier by, α 1.9, at most, one threshold", "s"),
    ]
    return (*lines, *before, *bounds)
