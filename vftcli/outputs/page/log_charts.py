"""The charts of one log: torques, wrenches, what the pose tells, responses, spectra and tuning."""

from collections.abc import Iterator, Mapping

import numpy as np

from vftcli.analysis import Analysis
from vftcli.observers.auto_tuning import Curve
from vftcli.observers.spectra import Spectra
from vftcli.observers.table import BEST
from vftcli.outputs.log.rmse_tables import blocks
from vftcli.outputs.page.charts import (
    REFERENCE,
    Chart,
    ChartLine,
    LineStyle,
    families_of,
    observer_lines,
)
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.external_torque import COVERS
from vftcli.signals.wrench import AXES, unit_of

FREQUENCIES = 120  #: Points of a frequency response.
#: Gain below which a response is drawn as -240 dB, so that its logarithm is finite; and the lowest
#: that is shown. [–], [dB]
QUIETEST, LOWEST = 1e-12, -80.0
#: Colours of the two spectra.
FREE, LOADED = "#3b7ea1", "#c2410c"


def torque_chart(analysis: Analysis) -> Chart:
    """External torque joint by joint: the best estimate with its band, the reference below it."""
    n, reference = analysis.recording.joints, analysis.reference
    found = blocks(analysis.errors) if analysis.errors is not None else ()
    return Chart(
        "tau",
        "External torque on the robot",
        ("N·m",) * n,
        # A dagger where the reference is not to be trusted, as in the tables.
        tuple(found[0].joint_heads) if found else tuple(f"J{j}" for j in range(1, n + 1)),
        analysis.t,
        (*reference_lines(analysis), *estimate_lines(analysis)),
        families=families_of(analysis.robot.limits.tau_max),
        band=None if reference is None else reference.floor,
        band_label="± floor of the reference",
        spans=contact_spans(analysis),
    )


def contact_spans(analysis: Analysis) -> tuple[tuple[float, float], ...]:
    """When something touched the arm. [s]"""
    found = analysis.contacts.contacts if analysis.contacts is not None else ()
    return tuple((contact.start, contact.stop) for contact in found if not contact.is_load)


def estimate_lines(analysis: Analysis) -> tuple[ChartLine, ...]:
    """Every observer's torque; one is drawn at once, `best` where it ran, with its 95 % band.

    Beside `best` no other bears a band: five would hide one another.
    """
    styles = observer_lines(analysis.estimates)
    alone = BEST not in styles
    first = next(iter(styles), "") if alone else BEST
    lines = [
        ChartLine(
            e.name,
            e.tau,
            *styles[e.name],
            half=COVERS * e.error_sd
            if e.error_sd is not None and (alone or e.name == first)
            else None,
            leads=e.name == first,
            shown=e.name == first,
        )
        for e in analysis.estimates
    ]
    return tuple(sorted(lines, key=lambda line: line.leads))


def reference_lines(analysis: Analysis) -> tuple[ChartLine, ...]:
    """The reference as a broad line below the others; dotted where it is not to be trusted."""
    if analysis.reference is None:
        return ()
    tau, moving = analysis.reference.tau, analysis.reference.moving
    whole = ChartLine(legend_name(analysis, "reference"), tau, REFERENCE)
    if moving is None or np.all(moving | ~np.isfinite(tau)):
        return (whole,)
    trusted = np.where(moving, tau, np.nan)
    resting = np.where(moving, np.nan, tau)
    name = "reference while the joint rests"
    return (whole._replace(values=trusted), ChartLine(name, resting, "#8a94a0", "1.5 3"))


def legend_name(analysis: Analysis, name: str) -> str:
    """A series' name in the legend: the reference's says which it is."""
    if name == "reference" and analysis.reference is not None:
        return f"reference ({analysis.reference.name})"
    return name


def response_charts(analysis: Analysis) -> tuple[Chart, ...]:
    """Gain, phase and delay of every observer over frequency, up to half the sample rate.

    Of observers whose joints differ the first joint is drawn.
    """
    step, n = analysis.recording.median_step, analysis.recording.joints
    frequency = np.geomspace(1e-2, 0.5 / step, FREQUENCIES)
    styles = observer_lines(analysis.estimates)
    columns: dict[str, list[ChartLine]] = {"gain": [], "phase": [], "delay": []}
    for observer in analysis.observers:
        response = observer.frequency_response(frequency, step, n)[:, :1]
        # Unwrapped, or a delay would jump by a period wherever the phase passes −180°.
        phase = np.degrees(np.unwrap(np.angle(response), axis=0))
        decibel = 20.0 * np.log10(np.maximum(np.abs(response), QUIETEST))
        # A phase of −φ degrees at f is a delay of φ / (360 f).
        delay = -1e3 * phase / (360.0 * frequency[:, None])
        for key, values in (("gain", decibel), ("phase", phase), ("delay", delay)):
            columns[key].append(ChartLine(observer.name, values, *styles[observer.name]))
    titles = {"gain": ("Gain", "dB"), "phase": ("Phase", "°"), "delay": ("Delay", "ms")}
    return tuple(
        Chart(
            key,
            title,
            (unit,),
            (f"{title}, joint 1",),
            frequency,
            tuple(columns[key]),
            unit="Hz",
            log=True,
            lowest=LOWEST if key == "gain" else None,
        )
        for key, (title, unit) in titles.items()
    )


def joint_panels(values: Array) -> tuple[str, ...]:
    """Names of the panels of a chart with one a joint."""
    return tuple(f"J{j}" for j in range(1, values.shape[1] + 1))


def wrench_chart(analysis: Analysis) -> Chart | None:
    """Force and moment axis by axis: the first wrench with its band, the reference below it."""
    found = [wrench for wrench in analysis.wrenches if wrench.name != "reference"]
    if not found:
        return None
    styles = observer_lines(analysis.estimates)
    first = next((w.name for w in found if w.name == BEST), found[0].name)
    lines = [
        ChartLine(
            w.name,
            w.known,
            *styles[w.name],
            half=COVERS * w.sd if w.sd is not None and w.name == first else None,
            leads=w.name == first,
            shown=w.name == first,
            quiet=quiet_samples(analysis, w.name),
        )
        for w in sorted(found, key=lambda wrench: wrench.name == first)
    ]
    reference = [w for w in analysis.wrenches if w.name == "reference"]
    below = [ChartLine(legend_name(analysis, w.name), w.known, REFERENCE) for w in reference]
    return Chart(
        "wrench",
        f"Wrench in {found[0].frame} axes",
        tuple(map(unit_of, AXES)),
        AXES,
        analysis.t,
        (*below, *lines),
        families=(1, 1, 1, 2, 2, 2),
        spans=contact_spans(analysis),
    )


def quiet_samples(analysis: Analysis, name: str) -> Mask | None:
    """Samples of a wrench outside of every listed contact, None where it asks no list. (T,)"""
    sensed = analysis.virtual_sensor
    found = None if sensed is None else sensed.smoothed.get(name)
    return found.unlisted(analysis.t) if found is not None and found.gate else None


def condition_charts(analysis: Analysis) -> Iterator[Chart]:
    """σ_min with the masked zone, what the solver says there, and the null-space channel."""
    sensed = analysis.virtual_sensor
    if sensed is None or not sensed.wrenches:
        return
    # σ_min and the mask follow from the pose, so that every observer has the same.
    first, t = sensed.wrenches[0], analysis.t
    styles = observer_lines(analysis.estimates)
    if first.sigma_min is not None:
        least = np.array([sensed.sensor.least_sigma])
        sigma = (ChartLine("σ_min of J", column(first.sigma_min)),)
        title = "What the pose can tell: σ_min"
        yield Chart(
            "sigma_min",
            title,
            ("m",),
            (title,),
            t,
            sigma,
            band=least,
            band_label="masked below",
            lowest=0.0,
        )
    if sensed.hides:
        blown = tuple(
            ChartLine(w.name, masked_force(w.values, w.hidden), *styles[w.name])
            for w in sensed.wrenches
            if w.hidden.any()
        )
        title = f"|force| by {sensed.sensor.solver} in the masked samples, not to be believed"
        yield Chart("blow-up", title, ("N",), (title,), t, blown)
    if first.null_space is not None:
        left = tuple(
            ChartLine(w.name, column(w.null_space), *styles[w.name])
            for w in sensed.wrenches
            if w.null_space is not None
        )
        limit = np.array([e.threshold for e in sensed.elsewhere[:1]])
        band = limit if limit.size else None
        title = "Torque that no wrench at the flange explains"
        yield Chart(
            "null_space", title, ("N·m",), (title,), t, left, band=band, band_label="free part"
        )


def column(values: Array) -> Array:
    """One series as a chart's only column. (T, 1)"""
    return values[:, None]


def masked_force(values: Array, hidden: Mask) -> Array:
    """Norm of the force in masked samples, NaN elsewhere. (T, 1) [N]"""
    norm = np.linalg.norm(values[:, :3], axis=1)
    return column(np.where(hidden, norm, np.nan))


def refined_charts(analysis: Analysis) -> list[Chart]:
    """Spectra and tuning of a complete log, as far as there are any."""
    found, charts = analysis.refinement, list[Chart]()
    if found is not None and (spectra := found.baselines.plain.spectra) is not None:
        charts.append(spectra_chart(spectra))
    if found is not None and found.curves:
        charts.append(tuning_chart(found.curves, observer_lines(analysis.estimates)))
    return charts


def spectra_chart(found: Spectra) -> Chart:
    """Spectra of the raw disturbance over both parts of the log; 0 Hz is left out."""

    def level(power: Array) -> Array:
        """Power in decibels; the least number above 0 stands for none at all."""
        decibels: Array = 10.0 * np.log10(np.maximum(power[1:], np.finfo(float).tiny))
        return decibels

    free = level(found.free)
    lines = (
        ChartLine("free part, S_n", free, FREE),
        ChartLine("loaded part, S_d", level(found.loaded), LOADED, "5 2"),
    )
    n = free.shape[1]
    return Chart(
        "spectra",
        "Spectrum of the disturbance, dB of 1 (N·m)²/Hz",
        ("dB",) * n,
        joint_panels(free),
        found.frequency[1:],
        lines,
        families=(1,) * n,
        unit="Hz",
        log=True,
    )


def tuning_chart(curves: Mapping[str, Curve], styles: Mapping[str, LineStyle]) -> Chart:
    """What was minimised for every observer that the log tuned."""
    lines = tuple(
        ChartLine(name, curve.rmse, *styles[name], x=curve.omega_n / (2.0 * np.pi))
        for name, curve in curves.items()
    )
    values = lines[0].values
    x = [line.x for line in lines if line.x is not None]
    ends = np.array([min(float(v.min()) for v in x), max(float(v.max()) for v in x)])
    return Chart(
        "curve",
        "Expected error against natural frequency ω_n/2π",
        ("N·m",) * values.shape[1],
        joint_panels(values),
        ends,
        lines,
        unit="Hz",
        log=True,
    )
