"""The table of observers: parameters, their sources and builders."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from vftcli.observers.observer import Observer
from vftcli.observers.paper import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
from vftcli.robots.profile import checked_gains
from vftcli.robots.robot_file import PER_JOINT, TEXT, RobotFile
from vftcli.signals.arrays import one_each
from vftcli.signals.errors import ParameterError
from vftcli.signals.option import assignment, set_value
from vftcli.signals.parsing import check_known, shown
from vftcli.signals.remarks import Remark, Where, caution, fact

if TYPE_CHECKING:
    from vftcli.observers.spectra import Spectra

Value = float | str | list[float]
#: Section of a file → parameter → number, list or word.
Gains = Mapping[str, Mapping[str, Any]]
#: Section ("fdo", "gmo", "kfo", or one observer's own name) → parameter → value.
Settings = dict[str, dict[str, Value]]
#: Section → its parameters; `kfo` holds for every Kalman filter.
PARAMETERS: dict[str, tuple[str, ...]] = {
    "fdo": ("omega",),
    "gmo": ("gain",),
    "kfo": ("r_diag", "q_p_diag", "q_tau_diag", "decay", "noise_convention"),
}
#: Every number of every observer, as in ``--set``.
NUMBERS = tuple(f"{name}.{number}" for name, each in PARAMETERS.items() for number in each)
#: Form of an assignment of ``--set``.
FORM = "OBSERVER.PARAMETER=VALUE, as gmo.gain=30 or gmo.gain=5,3,4,10,10,10"
WORDS = {"noise_convention"}  #: Parameters with words as values.
#: Parameters that are rates: no log resolves a microsecond. [1/s]
LARGEST = {"omega": 1e6, "gain": 1e6, "decay": 1e6}
#: Every other number is a variance, of 3·10⁷ N·m.
LARGEST_VARIANCE = 1e15
#: Smallest size of a number but zero: the ratio of two must stay a number.
SMALLEST = 1e-15


def parse_settings(assignments: Iterable[str]) -> Settings:
    """Assignments ``observer.parameter=VALUE``; a number or one a joint."""
    settings: Settings = {}
    for text in assignments:
        name, value = assignment(text, "--set", FORM)
        section, dot, parameter = name.partition(".")
        if not dot:
            raise ParameterError(f"--set {text!r} is not {FORM}")
        check_name(section, parameter)
        given: Value = value
        if parameter not in WORDS:
            given = set_value(value, text)
            check_range(parameter, given, f"--set {text!r}")
        settings.setdefault(section, {})[parameter] = given
    return settings


def check_name(section: str, parameter: str, where: str = "") -> None:
    """Raise a ParameterError unless the name exists."""
    check_known(section, SECTIONS, f"{where}no observer {section!r} to set")
    complaint = f"{where}{section} has no parameter {parameter!r}"
    check_known(parameter, SECTIONS[section], complaint)


def check_range(parameter: str, values: float | list[float], where: str) -> None:
    """Raise a ParameterError unless every number is possible for a parameter."""
    largest = LARGEST.get(parameter, LARGEST_VARIANCE)
    for value in values if isinstance(values, list) else [values]:
        # NaN is neither zero nor in the range.
        if value != 0 and not SMALLEST <= abs(value) <= largest:
            raise ParameterError(
                f"{where}: {shown(value)} is out of range; every number must be finite, "
                f"{SMALLEST:g} to {largest:g} in size"
            )


def check_gains(gains: Gains, where: str) -> None:
    """Raise a ParameterError on a file's unknown names or wild values."""
    for section, table in gains.items():
        for parameter, value in table.items():
            check_name(section, parameter, f"{where}: ")
            name = f"{where}: {section}.{parameter}"
            (TEXT if parameter in WORDS else PER_JOINT).check(name, value)
            if parameter not in WORDS:
                check_range(parameter, value, name)


def load_gains(path: Path) -> Gains:
    """Gains of their own TOML file, ``[observers.*]`` as in a robot file."""
    if not path.exists():
        raise ParameterError(
            f"{path}: no such file of gains; --gains takes auto, paper, or a file of identify "
            "--method gains"
        )
    root = RobotFile(path, "file of gains").root
    if "observers" not in root.values:
        raise ParameterError(
            f"{path}: no [observers.*] tables; a gains file is what vftcli identify --method gains "
            "writes, as [observers.gmo] gain = 10.0"
        )
    gains = checked_gains(root.section("observers"))
    check_gains(gains, str(path))
    return gains


def overlay_gains(under: Gains, over: Gains) -> Gains:
    """Gains of one source, overridden by another's."""
    return {name: {**under.get(name, {}), **over.get(name, {})} for name in {**under, **over}}


def parameters_given(setup: "Setup", section: str, name: str) -> dict[str, Any]:
    """An observer's parameters: the user's first, own before shared."""
    # kfo-zoh.r_diag is for that filter alone, kfo.r_diag for all.
    places = (
        (source, key) for source in (setup.gains, setup.settings) for key in (section, name)
    )
    return {key: value for source, at in places for key, value in source.get(at, {}).items()}


FALLBACK_RATE = 10.0  #: First-order gain of a robot without gains. [1/s]
BEST = "best"  #: The most accurate estimate that a log allows.


class LogSpectra(NamedTuple):
    """Noise and contact of a complete log, None without a free part."""

    plain: "Spectra | None" = None  #: Of the model's p and μ.
    best: "Spectra | None" = None  #: Of `best`'s, less the bias of the whole log.
    #: The gains from `plain`, in the form of a gains file.
    gains: Gains | None = None


class Setup(NamedTuple):
    """Parts of an observer before its build."""

    gains: Gains  #: The robot file's ``[observers.*]``.
    settings: Settings  #: The user's ``--set``.
    joints: int  #: Number of joints n.
    step: float  #: Nominal sample time. [s]
    as_printed: bool  #: Use the paper's printed formulas.
    shown: LogSpectra = LogSpectra()  #: Noise and contact of the complete log.


#: An observer, and remarks on gains that nobody gave.
Built = tuple[Observer, tuple[Remark, ...]]


class Entry(NamedTuple):
    """One line of the observer table."""

    title: str  #: The field's name for it.
    section: str  #: The ``--set`` section of its parameters.
    equations: str  #: The paper's equations.
    summary: str  #: Its work in a sentence.
    #: Builds it from a Setup and its name.
    build: Callable[[Setup, str], Built]
    from_spectra: bool = False  #: Whether the log gives its gains.
    online: bool = True  #: Whether it could run online.


def build_first_order(setup: Setup, name: str) -> Built:
    """The fdo or gmo with its gain (n,) [1/s], and a remark if nobody gave it.

    Then the inverse of the Kalman filter's delay, or `FALLBACK_RATE`; at most 2/Ts, above
    which it would overshoot. The fdo has one gain, that of the mean delay.
    """
    (parameter,), given = PARAMETERS[name], parameters_given(setup, name, name)
    full, origin = f"{name}.{parameter}", ""
    if parameter in given:
        rate = one_each(given[parameter], setup.joints, full)
    else:
        rate, origin = np.full(setup.joints, FALLBACK_RATE), "gain-from-default"
        if "kfo" in setup.gains or "kfo" in setup.settings:
            kalman, _ = build_kfo(read_as("density", setup), "kfo-fe")
            rate = 1.0 / kalman.tuning(setup.step, setup.joints).delay
            origin = "gain-from-kalman-delay"
        rate = np.minimum(rate, 2.0 / setup.step)
    said: dict[str, Any] = {"parameter": full, "gain": rate, "unit": "1/s"}
    if name == "fdo":
        if not origin and np.any(rate != rate[0]):
            raise ParameterError(
                "fdo.omega takes one cutoff for all joints; gmo.gain takes one each"
            )
        cutoff = float(1.0 / np.mean(1.0 / rate) if origin else rate[0])
        observer: Observer = FilteredDynamicsObserver(omega=cutoff, as_printed=setup.as_printed)
        said |= {"gain": cutoff, "unit": "rad/s"}
    else:
        observer = MomentumObserver(gain=rate, as_printed=setup.as_printed)
    return observer, (fact(origin, **said),) if origin else ()


def read_as(convention: str, setup: Setup) -> Setup:
    """A setup with its file's R and Q under this convention."""
    if "kfo" not in setup.gains:
        return setup
    file = {"noise_convention": convention, **setup.gains["kfo"]}
    return setup._replace(gains={**setup.gains, "kfo": file})


def build_kfo(setup: Setup, name: str) -> tuple[KalmanObserver, tuple[Remark, ...]]:
    """A Kalman observer with the parameters of this name.

    A file's R and Q are "discrete" unless a convention is named: so the paper's gains win
    joints 1 to 3, as in its Table I. Without a file they are densities.
    """
    given = parameters_given(read_as("discrete", setup), "kfo", name)
    convention = str(given.pop("noise_convention", "density"))
    values = {key: one_each(value, setup.joints, f"kfo.{key}") for key, value in given.items()}
    observer = KalmanObserver(
        discretisation="fe" if name == "kfo-fe" else "zoh",
        noise_convention="literal" if setup.as_printed else convention,
        as_printed=setup.as_printed,
        **values,
    )
    missing = [f"kfo.{k}" for k in ("r_diag", "q_p_diag", "q_tau_diag") if k not in values]
    if not missing:
        return observer, ()
    omega = observer.tuning(setup.step, setup.joints).omega_n[0]
    code = "kalman-gains-from-default"
    return observer, (fact(code, parameters=missing, omega_n_rad_per_s=omega),)


def build_rts(setup: Setup, _: str) -> Built:
    """Smoother on kfo-zoh: its noise leaves no bias on a ramp."""
    from vftcli.observers.smoother import KalmanSmoother

    kalman, remarks = build_kfo(setup, "kfo-rts")
    return KalmanSmoother(filter=kalman), remarks


def build_auto(setup: Setup, name: str) -> Built:
    """An observer with the log's gains, else those set by hand."""
    from vftcli.observers.tuning import AutoTuned, tune_to_spectra

    spectra = setup.shown.best if name == BEST else setup.shown.plain
    if spectra is not None:
        return tune_to_spectra(name, spectra), ()
    by_hand = build_kfo if name == "kfo-auto" else build_rts
    observer, remarks = by_hand(read_as("density", setup), "kfo-zoh")
    fallback = caution("tuning-without-free-part", Where(name), observer=observer.name)
    return AutoTuned(name=name, observer=observer), (*remarks, fallback)


#: Name at the command line → the observer.
OBSERVERS: dict[str, Entry] = {
    BEST: Entry(
        "the most accurate that a complete log allows",
        "kfo",
        "not in the paper",
        "rts-auto, with the fitted model error subtracted where the log allows it",
        build_auto,
        from_spectra=True,
        online=False,
    ),
    "fdo": Entry(
        "filtered dynamics observer",
        "fdo",
        "(19)–(29)",
        "low-pass filtered equation of motion; one cutoff for all joints",
        build_first_order,
    ),
    "gmo": Entry(
        "generalised momentum observer",
        "gmo",
        "(30)–(35)",
        "first-order residual of the momentum balance; one gain per joint",
        build_first_order,
    ),
    "kfo-fe": Entry(
        "disturbance Kalman filter, forward Euler",
        "kfo",
        "(36)–(42)",
        "momentum and a random-walk torque as states; three variances per joint",
        build_kfo,
    ),
    "kfo-zoh": Entry(
        "disturbance Kalman filter, zero-order hold",
        "kfo",
        "(36)–(40), (43), (44)",
        "kfo-fe with the exact process noise",
        build_kfo,
    ),
    "kfo-rts": Entry(
        "Rauch–Tung–Striebel smoother on kfo-zoh",
        "kfo",
        "not in the paper",
        "kfo-zoh over the whole log, both ways: no delay, but it rises before a tap begins",
        build_rts,
        online=False,
    ),
    "kfo-auto": Entry(
        "disturbance Kalman filter tuned by the log",
        "kfo",
        "not in the paper",
        "ω_n of each joint from the spectra of the log's contact-free part and the rest",
        build_auto,
        from_spectra=True,
        online=False,
    ),
    "rts-auto": Entry(
        "Rauch–Tung–Striebel smoother tuned by the log",
        "kfo",
        "not in the paper",
        "kfo-rts with the gains of kfo-auto",
        build_auto,
        from_spectra=True,
        online=False,
    ),
}
#: The paper's four, all of them online.
PAPER = ("fdo", "gmo", "kfo-fe", "kfo-zoh")
DEFAULT = (BEST, *PAPER)  #: The default.


#: The ``--set`` sections with parameters: shared, then each observer's.
SECTIONS: dict[str, tuple[str, ...]] = {
    **PARAMETERS,
    **{name: PARAMETERS[entry.section] for name, entry in OBSERVERS.items()},
}


def build_observers(
    names: Sequence[str], setup: Setup
) -> tuple[tuple[Observer, ...], tuple[Remark, ...]]:
    """Observers by name, keys of `OBSERVERS`, with remarks on gains not given.

    Raises:
        ParameterError: If a parameter is unknown or out of range.
    """
    built = [OBSERVERS[name].build(setup, name) for name in names]
    # Several observers may miss one gain: remark on it once.
    remarks = []
    for _, own in built:
        remarks += [remark for remark in own if remark not in remarks]
    return tuple(observer for observer, _ in built), tuple(remarks)
