"""The measure of bad samples and spans: that it sees a fault, and none where there is none."""

import numpy as np
import span_faults as measure
from planted_faults import Table
from planted_spans import SpanLog, span_faults, span_log


def test_every_fault_changes_the_log_and_states_the_rows_that_it_changes():
    """Of a UR10e that swings on every joint for 20 s."""
    t = np.arange(2000) / 100
    phase = 0.5 * t[:, None] + np.arange(6)
    q, dq = np.sin(phase), 0.5 * np.cos(phase)
    swinging = Table(
        t=t, q=q, dq=dq, effort=2.0 + dq, signal="current", robot="ur10e", given="ur10e",
        sound_t=t,
    )  # fmt: skip
    faults = span_faults(SpanLog(swinging, "ur10", free=True))
    assert len(faults) >= 60
    for name, fault in faults.items():
        made = fault(swinging)
        share = measure.bad_share(made, swinging)
        changed = share > 0 or made.given != swinging.given or len(made.t) < len(swinging.t)
        assert changed, name
        if "rows" in name:
            assert share == int(name.split()[-2]) / len(swinging.t), name


def test_what_a_fault_costs_is_measured_at_the_same_samples(logs, tmp_path):
    base = span_log("ur10e", logs)
    # Six seconds of it are enough for both observers.
    base = base._replace(table=base.table.between(0.0, 6.0), target=None)
    path = tmp_path / "log.csv"
    sound = measure.answer(base.table, path)
    none = measure.cell("ur10e", "none", lambda t: t, base, sound, path)
    assert (none.verdict, none.harmful, none.bad) == ("silent", False, 0.0)
    assert none.moved == {"best": 0.0, "gmo": 0.0}
