import numpy as np
import pytest
from unpacking import clock_of, page_data, unpacked

from vftcli.analysis import Analysis
from vftcli.outputs.charts import Chart, ChartLine
from vftcli.outputs.page.packing import MOST, STRETCHES, WHOLE, Blob, PageClock
from vftcli.outputs.page.packing import page_data as packed
from vftcli.outputs.page.pages import render
from vftcli.outputs.page.shell import script_json

RNG = np.random.default_rng(5)


def chart(t: np.ndarray, *lines: ChartLine, **kind: object) -> Chart:
    n = lines[0].values.shape[1]
    return Chart("k", "K", ("N",) * n, tuple("abcdefg"[:n]), t, lines, **kind)  # type: ignore[arg-type]


@pytest.mark.parametrize("scale", [1e-6, 3.0, 300.0, 1e7])
def test_values_are_kept_to_half_a_step(scale: float) -> None:
    """Jumps over the whole range and unknown samples are the hard cases of differences."""
    values = scale * RNG.uniform(-1.0, 1.0, 500)
    values[[3, 4, 499]] = np.nan
    values[10:14] = scale * np.array([1.0, -1.0, 1.0, -1.0])
    blob = Blob()
    blob.add(np.zeros(3), 0.1)
    row = blob.add(values, 1e-2 * scale)
    blob.add(np.full(2, np.nan), 0.0)
    found = unpacked(blob.data())
    assert [len(each) for each in found] == [3, 500, 2]
    # The rounding of a double on top.
    step = blob.steps[row]
    np.testing.assert_allclose(found[row], values, atol=0.5 * step * (1 + 1e-9), rtol=0)
    assert found[0].tolist() == [0.0, 0.0, 0.0]
    assert np.isnan(found[2]).all()
    # A step grows where values would not fit.
    row = blob.add(scale * np.array([-1e4, 1e4]), 0.01 * scale)
    assert blob.steps[row] == pytest.approx(1e4 * scale / MOST)


def test_a_clock_keeps_its_times_over_a_gap_of_an_hour() -> None:
    t = np.concatenate([0.002 * np.arange(50), 3600.0 + 0.002 * np.arange(50)])
    blob = Blob()
    clock = PageClock(blob, t)
    data = {**blob.data(), "clocks": [{"t": clock.rows}]}
    # Times are in ticks of 0.1 ms.
    np.testing.assert_allclose(clock_of(data, unpacked(data)), t, atol=0.51e-4)
    assert clock.gaps == [50]


@pytest.fixture(scope="module")
def long() -> tuple[np.ndarray, np.ndarray]:
    """Times and a line of 600 s at 1 kHz, with a spike of one sample and one unknown stretch."""
    t = 1e-3 * np.arange(600_000)
    y = np.sin(t) + RNG.normal(0.0, 0.1, len(t))
    y[345_678] = 77.0
    y[100_000:120_000] = np.nan
    return t, y[:, None]


def test_of_a_long_log_every_stretch_keeps_its_ends(long: tuple[np.ndarray, np.ndarray]) -> None:
    t, y = long
    near = (345.0, 346.0)
    data = packed([chart(t, ChartLine("a", y), ChartLine("b", y, shown=False), spans=[near])])
    rows = unpacked(data)
    first, second = data["charts"][0]["lines"]
    low, high = rows[first["low"][0]], rows[first["low"][0]] + rows[first["spread"][0]]
    times = clock_of(data, rows)
    assert len(low) == len(times) <= STRETCHES + 1
    step = data["steps"][first["low"][0]] + data["steps"][first["spread"][0]]
    assert np.nanmax(high) == pytest.approx(77.0, abs=step)
    assert abs(times[np.nanargmax(high)] - 345.678) < 2e-3
    assert np.nanmin(low) == pytest.approx(np.nanmin(y), abs=step)
    assert np.isnan(low[(times > 100.5) & (times < 119.5)]).all()
    # Half of the stretches are for the 2 s about the contact: each sample has its own.
    about = (times > 344.5) & (times < 346.5)
    assert about.sum() == pytest.approx(2000, abs=2)
    assert (~about).sum() == pytest.approx(STRETCHES / 2, rel=0.01)
    assert len(rows[second["low"][0]]) == -(-len(times) // 4)


def test_a_short_log_is_whole_and_clocks_are_shared(long: tuple[np.ndarray, np.ndarray]) -> None:
    t, y = (values[:WHOLE] for values in long)
    charts = [chart(x, ChartLine("a", y)) for x in (t, t, t.copy())]
    data = packed(charts)
    assert [each["clock"] for each in data["charts"]] == [0, 0, 1]
    assert len(data["clocks"]) == 2
    (line,) = data["charts"][0]["lines"]
    assert "spread" not in line
    row = line["low"][0]
    half = 0.5 * data["steps"][row] * (1 + 1e-9)
    np.testing.assert_allclose(unpacked(data)[row], y[:, 0], atol=half)


def test_the_page_holds_every_estimate_and_position(analysis: Analysis) -> None:
    data = page_data(render(analysis))
    rows = unpacked(data)
    np.testing.assert_allclose(clock_of(data, rows), analysis.t, atol=0.51e-4)
    (torques,) = (each for each in data["charts"] if each["key"] == "tau")
    estimates = {estimate.name: estimate.tau for estimate in analysis.estimates}
    assert estimates.keys() <= {line["name"] for line in torques["lines"]}
    for line in torques["lines"][1:]:
        for joint, row in enumerate(line["low"]):
            half = 0.5 * data["steps"][row] * (1 + 1e-9)
            assert half <= 0.005 * (1 + 1e-9)  # half of 0.01 N·m
            np.testing.assert_allclose(rows[row], estimates[line["name"]][:, joint], atol=half)
    for joint, row in enumerate(data["stage"]["q"]):
        np.testing.assert_allclose(rows[row], analysis.recording.q[:, joint], atol=1.01e-4)


@pytest.mark.slow
def test_the_data_of_ten_minutes_are_small() -> None:
    """600 s at 1 kHz: six joints by five observers and a reference, six axes, with noise."""
    t = 1e-3 * np.arange(600_000)
    wave = 20.0 * np.sin(t[:, None] * np.linspace(0.3, 1.1, 6)) ** 9
    names = ("reference", "best", "fdo", "gmo", "kfo-fe", "kfo-zoh")
    noisy = [wave + RNG.normal(0.0, 0.2, wave.shape) for _ in names]
    lines = [ChartLine(names[k], noisy[k], shown=k < 2) for k in range(len(names))]
    lines[1] = lines[1]._replace(half=np.full(wave.shape, 0.7))
    charts = [chart(t, *lines), chart(t, lines[1])]
    # A page of 1 MB has 350 kB for drawings, style, script and tables.
    assert len(script_json(packed(charts))) < 650_000
