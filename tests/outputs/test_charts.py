import numpy as np
import pytest

from vftcli.outputs import charts


def test_observers_keep_their_colours_and_others_get_ones_that_nobody_has() -> None:
    assert charts.colours_of_names(["gmo"])["gmo"] == charts.COLOURS["gmo"]
    found = charts.colours_of_names(["a", "fdo", "b", "gmo"])
    assert len(set(found.values())) == 4
    assert found["gmo"] == charts.COLOURS["gmo"]
    assert found["a"] not in (charts.COLOURS["fdo"], charts.COLOURS["gmo"])
    names = [f"own {k}" for k in range(len(charts.SPARE) + 1)]
    found = charts.colours_of_names(names)
    assert len(set(found.values())) == len(charts.SPARE)
    assert found[names[0]] == found[names[-1]]  # there are no more


def test_no_spike_is_lost() -> None:
    t = np.linspace(1.0, 1000.0, 20_000)
    y = np.zeros_like(t)
    y[[777, 15_000]] = 9.0, -9.0
    found = charts.thinned(t, y, charts.STRETCHES)
    assert len(found[0]) < 1200
    assert {9.0, -9.0} <= set(found[1])
    assert found[0][np.argmax(found[1])] == t[777]


def test_a_ribbon_is_grey_where_no_contact_is_listed() -> None:
    quiet = np.array([True, True, False, False, True, True])
    line = charts.ChartLine("best", np.zeros((6, 1)), half=np.full((6, 1), 2.0), quiet=quiet)
    chart = charts.Chart("k", "K", ("N",), ("a",), np.arange(6.0), (line,))
    own, grey = charts.drawn_line(chart, line, 0)[2]
    assert np.isnan(own).tolist() == quiet.tolist()
    np.testing.assert_array_equal(np.where(quiet, grey, own), 2.0)


@pytest.mark.parametrize("seed", range(5))
def test_extremes_of_every_stretch_survive_at_their_own_times(seed: int) -> None:
    rng, stretches, width = np.random.default_rng(seed), 50, 40
    t = np.sort(rng.uniform(0.0, 10.0, stretches * width))
    values = rng.normal(size=(len(t), 3))
    spike = int(rng.integers(len(t)))
    values[spike, 1] = 1e3
    for column in values.T:
        x, y = charts.thinned(t, column, stretches)
        assert np.all(np.diff(x) > 0)
        assert (x[0], x[-1]) == (t[0], t[-1])
        drawn = dict(zip(x.tolist(), y.tolist(), strict=True))
        cut = column.reshape(stretches, width)
        for k in range(stretches):
            for at in (cut[k].argmin(), cut[k].argmax()):
                index = k * width + int(at)
                assert drawn[t[index]] == column[index]
        assert len(x) <= 2 * stretches + 2 + 3 * 20  # the random clock has a few gaps
    assert np.nanmax(charts.thinned(t, values[:, 1], stretches)[1]) == 1e3


def test_what_is_unknown_stays_so_and_few_samples_are_all_there() -> None:
    t = 0.001 * np.arange(10_001)
    assert np.all(np.isnan(charts.thinned(t, np.full(len(t), np.nan), 20)[1]))
    few = 0.1 * np.arange(200)
    np.testing.assert_array_equal(charts.thinned(few, few**2, 100)[1], few**2)


def test_a_line_breaks_at_gaps_and_unknown_stretches() -> None:
    t = np.concatenate([0.01 * np.arange(510), 20.0 + 0.01 * np.arange(490)])
    values = np.ones(1000)
    values[100:300] = np.nan
    x, y = charts.thinned(t, values, 20)
    # One in each unknown stretch of 50 samples; the gap's is between the samples beside it.
    np.testing.assert_allclose(x[np.isnan(y)], [1.0, 1.5, 2.0, 2.5, 12.545])
    last = int(np.flatnonzero(np.isnan(y))[-1])
    np.testing.assert_allclose(x[last - 1 : last + 2], [5.09, 12.545, 20.0])


def test_of_a_plot_the_spike_of_one_sample_survives_in_every_line_at_its_own_time() -> None:
    rng, stretches = np.random.default_rng(2), 40
    t = 0.001 * np.arange(10_000)
    values = rng.normal(size=(len(t), 3))
    spikes = rng.choice(len(t), 3, replace=False)
    values[spikes, [0, 1, 2]] = 1e3, -1e3, 1e3
    rows = charts.level_rows(t, list(values.T), stretches)
    assert set(spikes) <= set(rows)
    assert {0, len(t) - 1} <= set(rows)
    assert len(rows) <= 2 * 3 * stretches + 2
    cut = values.reshape(stretches, -1, 3)
    for extreme in (cut.argmin(axis=1), cut.argmax(axis=1)):
        assert set((extreme + 250 * np.arange(stretches)[:, None]).ravel()) <= set(rows)


def test_every_sample_of_a_whole_span_and_the_edges_of_what_is_unknown_stay() -> None:
    t = 0.001 * np.arange(10_000)
    values = np.where((t > 3.0005) & (t < 3.0105), np.nan, np.sin(t))[:, None]
    rows = charts.level_rows(t, list(values.T), 40, [(6.9995, 7.1005), (9.9, 12.0)])
    assert {*range(7000, 7101), *range(9900, 10_000)} <= set(rows)
    assert np.isnan(values[rows]).any()  # ten unknown samples amid a stretch of 250
    assert len(rows) <= 2 * 40 + 2 + 1 + 101 + 100
    # Two of each line and stretch: as many as there are.
    assert charts.level_rows(t[:1200], list(np.zeros((3, 1200))), 200) is None
    assert charts.level_rows(t[:1200], list(np.zeros((3, 1200))), 199) is not None
