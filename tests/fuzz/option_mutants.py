"""Words of the command line, drawn from what it takes and from what it does not."""

from tokens import NUMBERS, WORDS, Rng, pick

SIGNALS = (
    "t", "q", "dq", "current", "tau", "effort", "tau_ext", "wrench", "target_q", "_",
    "temperature",
)  # fmt: skip
UNITS = ("", "", "", "[deg]", "[ms]", "[ns]", "[mA]", "[base]", "[x]", "[", "[]")
PATTERNS = (
    "q_{i}", "dq_{i}", "tau_{i}", "t", "{i}", "q_{i}{i}", "q[0:6]", "q[", "q_0|q_1", "", "*", "q_*",
)  # fmt: skip
SETTINGS = (
    "gmo.gain", "fdo.omega", "kfo.r_diag", "kfo.q_tau_diag", "kfo.q_p_diag", "kfo.decay",
    "kfo-fe.r_diag", "kfo.noise_convention", "gmo", "x.y", "gmo.gain.x",
)  # fmt: skip


def columns(rng: Rng) -> str:
    """A --columns SPEC, by order or by header, mostly nearly right."""
    parts = []
    for _ in range(int(rng.integers(1, 6))):
        sign = pick(rng, ("", "", "", "-", "+", "--"))
        name = pick(rng, SIGNALS) if rng.random() < 0.9 else pick(rng, WORDS)[:40]
        if rng.random() < 0.5:
            count = pick(rng, ("", ":6", ":7", ":1", ":0", ":-1", ":x", ":99999999999", ":6:6"))
            parts.append(f"{sign}{name}{pick(rng, UNITS)}{count}")
        else:
            parts.append(f"{sign}{name}{pick(rng, UNITS)}={pick(rng, PATTERNS)}")
    return pick(rng, (",", ",", ",", ", ", ";", ",,")).join(parts)


def span(rng: Rng) -> str:
    ends = [str(pick(rng, (*NUMBERS, "", 0.1, 0.3, 0.5, "x"))) for _ in range(2)]
    return pick(rng, (":", ":", ":", "-", "::")).join(ends)


def setting(rng: Rng) -> str:
    name = pick(rng, SETTINGS)
    value = ",".join(str(pick(rng, NUMBERS)) for _ in range(int(pick(rng, (1, 1, 6, 7)))))
    return f"{name}={value if rng.random() < 0.8 else pick(rng, WORDS)[:40]}"


def pose(rng: Rng) -> str:
    return ",".join(str(pick(rng, (*NUMBERS, 0.1, 0.2))) for _ in range(int(rng.integers(2, 8))))


OPTIONS = {
    "--columns": columns,
    "--interval": span,
    "--free": span,
    "--zero": span,
    "--set": setting,
    "--observer": lambda rng: pick(rng, ("gmo", "fdo", "kfo-rts", "kfo-auto", "rts-auto", "x", "")),
    "--gains": lambda rng: pick(rng, ("delay=", "bandwidth=", "x=", "")) + str(pick(rng, NUMBERS)),
    "--robot": lambda rng: pick(rng, ("ur5", "panda", "ur10e", "UR5", "", "x.toml", "/dev/null")),
    "model.friction": lambda rng: pick(rng, ("none", "profile", "x")),
    "log.format": lambda rng: pick(rng, ("table", "ur-csv", "libfranka-csv", "npz", "x", "")),
    "--frame": lambda rng: pick(rng, ("flange", "base", "tool", "sensor", "x")),
    "virtual-sensor.solver": lambda rng: pick(rng, ("pinv", "map", "x")),
    "virtual-sensor.tool": pose,
    "virtual-sensor.sensor": pose,
    "virtual-sensor.torque-sd": lambda rng: str(pick(rng, (*NUMBERS, "own"))),
    "two-cycle.period": lambda rng: str(pick(rng, NUMBERS)),
    "two-cycle.free-cycles": lambda rng: pick(
        rng, ("1", "1,2", "1-3", "0", "9-1", "x", "1-999999999")),
    "two-cycle.low-pass": lambda rng: str(pick(rng, (*NUMBERS, "auto", "none", "x"))),
    "two-cycle.alignment": lambda rng: pick(rng, ("auto", "phase", "model", "x")),
    "bias.method": lambda rng: pick(rng, ("whole-log", "none", "x")),
    "--payload": lambda rng: pick(rng, ("franka_hand", "x", "")),
}  # fmt: skip

INSPECTED = ("--columns", "--interval", "log.format", "--robot")
"""Those that inspect takes too."""


def option_words(rng: Rng, command: str) -> list[str]:
    """One to three options of a command, with their values."""
    names = INSPECTED if command == "inspect" else tuple(OPTIONS)
    words: list[str] = []
    for _ in range(int(rng.integers(1, 4))):
        name = pick(rng, names)
        value = OPTIONS[name](rng).replace("\0", "")
        words += [f"{name}={value}"] if name.startswith("-") else ["--set", f"{name}={value}"]
    return words
