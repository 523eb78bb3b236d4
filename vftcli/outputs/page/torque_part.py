"""Joint torques over time, observers and their responses, as charts of the page of one log."""

from itertools import groupby
from operator import itemgetter

import numpy as np

from vftcli.analysis import Analysis
from vftcli.observers.table import BEST
from vftcli.outputs.log.rmse_tables import blocks
from vftcli.outputs.page.charts import (
    REFERENCE,
    Chart,
    ChartLine,
    families_of,
    large,
    multiples,
    observer_lines,
)
from vftcli.outputs.page.shell import section, soft
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import COVERS

FREQUENCIES = 120  #: Points of a frequency response.
#: Gain below which a response is drawn as -240 dB, so that its logarithm is finite; and the lowest
#: that is shown. [–], [dB]
QUIETEST, LOWEST = 1e-12, -80.0


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


def torque_section(chart: Chart, *, opened: bool = False) -> str:
    """The charts with what they show in words."""
    shown = next((line.name for line in chart.series if line.leads), "")
    others = [line.name for line in chart.series if not line.shown]
    state = f"{shown}; {len(others)} more on demand" if others else shown
    words = scale_words(chart)
    drawn = multiples(chart) + soft(words) + large(chart)
    return section("Joint torques", drawn, state, name="torques", opened=opened)


def scale_words(chart: Chart) -> str:
    """Which pictures share a scale, in words."""
    numbered = groupby(zip(chart.families, chart.panels, strict=False), key=itemgetter(0))
    families = [[name for _, name in members] for _, members in numbered]
    shared = [f"{names[0]}–{names[-1]}" for names in families if len(names) > 1]
    if not shared:
        return "Every joint has its own scale."
    rest = "; the others have their own" if any(len(names) == 1 for names in families) else ""
    return f"One scale in {' and in '.join(shared)}{rest}."


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
