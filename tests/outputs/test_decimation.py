import numpy as np
import pytest

from vftcli.outputs.decimation import decimated, extremes, level_rows


@pytest.mark.parametrize("seed", range(5))
def test_extremes_of_every_stretch_survive(seed: int) -> None:
    rng, stretches, width = np.random.default_rng(seed), 50, 40
    t = np.sort(rng.uniform(0.0, 10.0, stretches * width))
    values = rng.normal(size=(len(t), 3))
    spike = int(rng.integers(len(t)))
    values[spike, 1] = 1e3
    for line, column in zip(decimated(t, values, stretches), values.T, strict=True):
        drawn = dict(zip(line.t.tolist(), line.y.tolist(), strict=True))
        cut = column.reshape(stretches, width)
        for k in range(stretches):
            for at in (cut[k].argmin(), cut[k].argmax()):
                index = k * width + int(at)
                assert drawn[t[index]] == column[index]
        assert len(line.t) <= 2 * stretches + 2 + 3 * 20  # the random clock has a few gaps
    assert np.nanmax(decimated(t, values, stretches)[1].y) == 1e3


def test_every_point_is_a_sample_at_its_own_time() -> None:
    t = 0.001 * np.arange(10_001)
    values = np.random.default_rng(1).normal(size=(len(t), 2))
    for line, column in zip(decimated(t, values, 100), values.T, strict=True):
        assert np.all(np.diff(line.t) > 0)
        np.testing.assert_array_equal(line.y, column[np.searchsorted(t, line.t)])
        assert line.t[0] == t[0]
        assert line.t[-1] == t[-1]


def test_a_short_log_is_kept_whole() -> None:
    t = 0.1 * np.arange(200)
    (line,) = decimated(t, t[:, None] ** 2, 100)
    np.testing.assert_array_equal(line.y, t**2)


def test_a_line_breaks_at_gaps_and_unknown_stretches() -> None:
    t = np.concatenate([0.01 * np.arange(500), 20.0 + 0.01 * np.arange(500)])
    values = np.ones((1000, 1))
    values[100:300] = np.nan
    (line,) = decimated(t, values, 20)
    breaks = line.t[np.isnan(line.y)]
    assert np.any((breaks > 1.0) & (breaks < 3.0))
    assert np.any((breaks > 5.0) & (breaks < 20.0))


def test_nothing_known_is_nothing_drawn() -> None:
    t = 0.01 * np.arange(1000)
    (line,) = decimated(t, np.full((1000, 1), np.nan), 20)
    assert np.all(np.isnan(line.y))


def test_of_a_plot_the_spike_of_one_sample_survives_in_every_line_at_its_own_time() -> None:
    rng, stretches = np.random.default_rng(2), 40
    t = 0.001 * np.arange(10_000)
    values = rng.normal(size=(len(t), 3))
    spikes = rng.choice(len(t), 3, replace=False)
    values[spikes, [0, 1, 2]] = 1e3, -1e3, 1e3
    rows = level_rows(t, values, stretches)
    assert rows is not None
    assert set(spikes) <= set(rows)
    assert {0, len(t) - 1} <= set(rows)
    assert len(rows) <= 2 * 3 * stretches + 2
    lows, highs = extremes(values, stretches)
    assert set(lows.ravel()) | set(highs.ravel()) <= set(rows)


def test_every_sample_of_a_whole_span_and_the_edges_of_what_is_unknown_stay() -> None:
    t = 0.001 * np.arange(10_000)
    values = np.where((t > 3.0005) & (t < 3.0105), np.nan, np.sin(t))[:, None]
    rows = level_rows(t, values, 40, [(6.9995, 7.1005), (9.9, 12.0)])
    assert rows is not None
    assert {*range(7000, 7101), *range(9900, 10_000)} <= set(rows)
    assert np.isnan(values[rows]).any()  # ten unknown samples amid a stretch of 250
    assert len(rows) <= 2 * 40 + 2 + 1 + 101 + 100


def test_a_plot_that_levels_would_not_shorten_is_kept_whole() -> None:
    t = 0.001 * np.arange(1200)
    values = np.zeros((1200, 3))
    assert level_rows(t, values, 200) is None  # two of each line and stretch: as many
    assert level_rows(t, values, 199) is not None
