"""What is said of swinging joints by their signals alone: known amounts of each fault, just inside
and just outside of its limit.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter
from swinging import (
    DQ,
    RATES,
    STEP,
    TORQUE,
    Case,
    Q,
    Said,
    T,
    Unsaid,
    found,
    has,
    has_if,
    log_of,
    only,
    only_if,
    said_of,
    scaled,
    speed_at,
)

from vftcli.doctor import examine
from vftcli.doctor.signals import inverted_effort
from vftcli.doctor.velocity import velocity_fit
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording, Source
from vftcli.signals.remarks import Remark

approx = pytest.approx
ALL = (1, 2, 3, 4, 5, 6)
FRICTION = np.sign(DQ) * (1 + 1e-3 * np.sin(np.arange(len(T)))[:, None])
"""Dry friction of 1 N·m, with a ripple of a thousandth lest it stays at its extreme. (T, 6)"""


def log_with(steps: Array) -> Recording:
    """A log of two moving joints whose samples are so far apart. (T - 1,) [s]"""
    t = np.concatenate([[0.0], np.cumsum(steps)])
    q, dq = np.column_stack([np.sin(t), np.cos(t)]), np.column_stack([np.cos(t), -np.sin(t)])
    return log_of(t=t, q=q, dq=dq)


def steps_with(count: int, factor: float, of: int = 1000) -> Array:
    """So many steps, a few of them, spread over the log, longer by a factor. [s]"""
    steps = np.full(of, STEP)
    steps[np.linspace(10, of - 10, count).astype(int)] *= factor
    return steps


def with_stale(count: int, scale: float = 1.0) -> Recording:
    """A log of 1001 samples, so many of which repeat the row before them."""
    t, source = STEP * np.arange(1001), np.arange(1001)
    for k in np.linspace(2, 999, count).astype(int):
        source[k] = source[k - 1]
    q = np.column_stack([np.sin(t), np.cos(t)])[source]
    dq = scale * np.column_stack([1 + np.sin(t), 1 + np.cos(t)])[source]
    return Recording(t=t, q=q, dq=dq, torque=t[source][:, None] * [1.0, 2.0])


def jittering(half: float) -> Array:
    """A tenth of the steps is shorter, a tenth longer: the spread of nine in ten is twice that."""
    steps = np.full(1000, STEP)
    steps[5::10] *= 1 - half
    steps[::10] *= 1 + half
    return steps


def rarely_jittering(longer: int) -> Array:
    steps = np.full(1000, STEP)
    steps[100:140], steps[200 : 200 + longer] = 0.5 * STEP, 1.5 * STEP
    return steps


def with_gap(longest: float) -> Array:
    steps = steps_with(0, 1.0)
    steps[300], steps[600] = 0.05, longest
    return steps


def of_clock() -> Iterator[Case]:
    def case(name: str, steps: Array, said: Said | Unsaid) -> Case:
        return Case(name, lambda: said_of(log_with(steps)), said)

    # Steps of 1/64 s are exact, so 129 samples last 2 s to the bit and are long enough.
    for samples, code in ((2, "too-short"), (8, "short"), (126, "short"), (129, ""), (131, "")):
        ends = {"duration_s": approx((samples - 1) / 64), "level": "fact"}
        last = ends if code == "short" else {}
        yield case(f"{samples} samples", np.full(samples - 1, 1 / 64), only(code, **last))
    for rate in (49.0, 51.0):
        slow = only_if(rate < 50, "slow-rate", level="warning", rate_Hz=approx(rate))
        yield case(f"{rate} Hz", np.full(1000, 1 / rate), slow)
    # One in a thousand is nothing to tell; half a sample time late is late, not missed.
    for count, factor in ((1, 2.0), (2, 2.0), (7, 1.5), (7, 1.7), (7, 3.3), (7, 3.5)):
        there = (count, factor) in ((2, 2.0), (7, 1.7), (7, 3.3))
        missing = only_if(there, "missing-samples", missed=count, steps=1000)
        yield case(f"{count} steps of {factor}", steps_with(count, factor), missing)
    for half in (0.0, 0.02, 0.03):
        ends = {"low_ms": approx(10 * (1 - half)), "high_ms": approx(10 * (1 + half))}
        uneven = only_if(half > 0.025, "jitter", spread_percent=approx(200 * half),
                         clock="as given", **ends)  # fmt: skip
        yield case(f"jitter of {half}", jittering(half), uneven)
    # Four in a hundred steps at either end lie outside the nine in ten, seven do not.
    for longer in (40, 70):
        yield case(f"rarely {longer}", rarely_jittering(longer), has_if(longer > 40, "jitter"))
    # A tenth of the steps are that long: as jitter they would be reported at once.
    yield case("3.9 sample times", steps_with(100, 3.9), only("jitter"))
    yield case("4.1 sample times", steps_with(100, 4.1), only("gaps", gaps=100, steps=4.0))
    # A tenth of a second can hide a whole contact.
    for longest, level in ((0.09, "fact"), (0.11, "warning")):
        at = approx(600 * STEP + 0.05 - STEP)
        gaps = has("gaps", level=level, gaps=2, longest_s=approx(longest), at_s=at)
        yield case(f"a gap of {longest} s", with_gap(longest), gaps)


def of_rows() -> Iterator[Case]:
    for repeats, level in ((1, "fact"), (20, "fact"), (22, "warning")):
        source = Source(duplicates=repeats, rows=200)
        log = replace(log_with(steps_with(0, 1.0)), source=source)
        share = {"repeats": repeats, "rows": 200, "share_percent": approx(repeats / 2)}
        yield Case(f"{repeats} repeated stamps", lambda log=log: said_of(log),
                   has("repeated-stamps", level=level, **share))  # fmt: skip
    # An arm at rest repeats nearly all its rows.
    for count, there in ((2, False), (3, True), (10, True), (880, True), (920, False)):
        stale = has_if(there, "stale-rows", level="fact", stale=count,
                       share_percent=approx(count / 10))  # fmt: skip
        yield Case(f"{count} stale rows", lambda count=count: said_of(with_stale(count)), stale)
    # Where no joint is faster than 1 mrad/s equal rows are what a resting arm gives.
    for scale in (0.6e-3, 0.4e-3):
        yield Case(f"stale rows at {2 * scale} rad/s",
                   lambda scale=scale: said_of(with_stale(50, scale)),
                   has_if(scale > 0.5e-3, "stale-rows"))  # fmt: skip
    log = with_stale(50)
    for name, change in (
        ("temperature", np.column_stack([log.t, log.t])),
        ("q", log.q + np.outer(log.t, [0.0, 1.0])),
        ("dq", None),
    ):
        other = replace(log, **{name: change})
        yield Case(f"stale but for {name}", lambda log=other: said_of(log), Unsaid("stale-rows"))


def changed(name: str, said: Said | Unsaid, **changes: Any) -> Case:
    return Case(name, lambda: found(**changes), said)


def with_column(x: Array, values: Any, *joints: int, rows: Any = slice(None)) -> Array:
    """A signal with other values in some columns, counted from 1. (T, n)"""
    out = np.array(x)
    for joint in joints:
        out[rows, joint - 1] = values
    return out


def with_column_late(samples: float) -> Array:
    late = speed_at(T - samples * STEP)
    return np.where(np.isin(ALL, (1, 4)), late, DQ)


def held(x: Array, samples: int) -> Array:
    rows = np.arange(len(x))
    return x[rows - rows % samples]


def filtered(dq: Array, cut_off: float) -> Array:
    """Velocities behind a first-order low-pass. [Hz]"""
    keep = np.exp(-2 * np.pi * cut_off * STEP)
    return np.asarray(lfilter([1 - keep], [1, -keep], dq, axis=0, zi=keep * dq[:1])[0])


RAMP = np.clip(np.abs((T % 10) - 5) - 2.5, -1, 1)[:, None] * np.ones(6)
"""A trapezoid of speed. [rad/s]"""
TURNED = np.cumsum(RAMP, axis=0) * STEP
RESTS = np.where((T % 10 < 5)[:, None], DQ, 0.0)
KINDS = {57.3: "deg/s", 1 / 57.3: "rad/s, beside positions in degrees",
         50.0: "the motor's side of the gear", 101.0: "the motor's side of the gear",
         1.55: "another motion or unit", 0.6: "another motion or unit"}  # fmt: skip
"""Factor of a velocity → what it is then."""


def of_velocity() -> Iterator[Case]:
    # A twentieth of a radian of travel tells; the swing is 2 rad.
    for travel in (0.048, 0.052):
        yield changed(f"travel of {travel}", has_if(travel > 0.05, "velocity-sign"),
                      q=scaled(Q, travel / 2, 2), dq=scaled(DQ, -travel / 2, 2))  # fmt: skip
    for samples in (64, 65):  # eight windows
        yield changed(f"velocity of {samples} samples", has_if(samples > 64, "velocity-unit"),
                      t=T[:samples], q=Q[:samples], dq=np.rad2deg(DQ[:samples]))  # fmt: skip
    # The arm turns by .3 rad in every other second, of which nothing is recorded.
    gaps = np.arange(4001) // 100
    yield changed("motion in gaps", only("gaps"), t=T + gaps, q=Q + 0.3 * gaps[:, None])
    for factor in (0.97, 0.99, 1.01):
        size = only_if(factor < 0.98, "velocity-mismatch", 3, 5,
                       slopes=approx([factor, factor], rel=2e-4))  # fmt: skip
        yield changed(f"dq times {factor}", size, dq=scaled(DQ, factor, 3, 5))
    yield changed("dq J2 turned", only("velocity-sign", 2), dq=scaled(DQ, -1.0, 2))
    yield changed("dq turned", has("velocity-sign", *ALL), dq=-DQ)
    for factor in (57.3, 60.0, 1 / 57.3, 1 / 60.0):
        unit = only("velocity-unit", slope=approx(factor, rel=2e-4))
        yield changed(f"dq of all times {factor:.3g}", unit, dq=DQ * factor)
    for factor, quantity in KINDS.items():
        kind = only("velocity-of-another-kind", 1, 2, quantity=quantity)
        yield changed(f"dq of two times {factor:.3g}", kind, dq=scaled(DQ, factor, 1, 2))
    # The motion holds whole swings, over which velocity and acceleration have nothing alike.
    for dq, quantity in ((101 * DQ, KINDS[101.0]), (-(RATES**2) * Q, "the joint's acceleration")):
        kind = only("velocity-of-another-kind", *ALL, quantity=quantity)
        yield changed(f"dq is {quantity}", kind, dq=dq)


def of_velocity_clock() -> Iterator[Case]:
    for factor, pace in (
        (0.9, "slow"),
        (0.975, "slow"),
        (0.985, ""),
        (1.015, ""),
        (1.05, "fast"),
    ):
        rate = only_if(bool(pace), "clock-rate", gain=approx(factor, rel=2e-4), pace=pace,
                       percent=approx(100 * abs(factor - 1), abs=0.02))  # fmt: skip
        yield changed(f"clock times {factor}", rate, t=factor * T)
    # Milliseconds read as seconds also look like a tenth of a sample a second.
    for factor, unit in ((1e3, "ms"), (1e6, "us"), (1e9, "ns"), (1e-3, "s"), (950.0, "ms")):
        yield changed(f"stamps times {factor:g}", only("time-unit", unit=unit), t=factor * T)
    # σ = 0.05 rad/s on steps of 1 ms read as seconds: eight of them as a window are too few.
    t = 1e-3 * np.arange(8000)
    q = np.sin(np.outer(t, RATES))
    for seed in (0, 1):
        noise = np.random.default_rng(seed).normal(0, [[1e-5], [0.05]], (8000, 6, 2, 1))
        yield changed(f"noisy ms {seed}", only("time-unit"), t=1e3 * t, q=q + noise[..., 0, 0],
                      dq=speed_at(t) + noise[..., 1, 0])  # fmt: skip
    for samples in (0.9, 1.2, 3, -3):
        lag = only_if(samples != 0.9, "velocity-lag", 1, 4,
                      lags_ms=approx([10 * samples] * 2, rel=0.01))  # fmt: skip
        yield changed(f"dq {samples} samples late", lag, dq=with_column_late(samples))
    # A real FR3's velocities are 2.9 ms late, those of a host's stamps up to 5.7.
    for late in (7, 9):
        yield changed(f"dq {late} ms late", only_if(late == 9, "velocity-lag"),
                      t=t, q=q, dq=speed_at(t - 1e-3 * late))  # fmt: skip


def of_velocity_order() -> Iterator[Case]:
    # Two joints of one rate, a quarter turn apart: a filter brings one closer to the other.
    phase = RATES[0] * T - 0.3
    dq = filtered(with_column(DQ, RATES[0] * np.cos(phase), 6), 0.5)
    yield changed("filtered twins", only("velocity-filtered"),
                  q=with_column(Q, np.sin(phase), 6), dq=dq)  # fmt: skip
    exchanged = DQ[:, [0, 3, 2, 1, 4, 5]]
    yield changed("dq J2 and J4 exchanged", only("velocity-order", 2, 4), dq=exchanged)
    yield changed("dq of three", has("velocity-order", 1, 2, 3), dq=DQ[:, [1, 2, 0, 3, 4, 5]])
    # In a plane the elbow often turns against the shoulder: own fits too, with another gain.
    q, dq = with_column(Q, -1.4 * Q[:, 1], 3), with_column(DQ, -1.4 * DQ[:, 1], 3)
    exchanged = dq[:, [0, 2, 1, 3, 4, 5]]
    yield changed("elbow as shoulder", only("velocity-order", 2, 3), q=q, dq=exchanged)
    # J6 rests; J5's velocity is its own, J6's that of J5: both are reported, neither as a size.
    q, dq = scaled(Q, 0.0, 6), scaled(DQ, 0.0, 6)[:, [0, 1, 2, 3, 5, 4]]
    frozen = "still-joint stuck-velocity stuck-position"
    yield changed("dq of a rest", only("velocity-order", 5, 6, beside=frozen), q=q, dq=dq)
    # Held for two samples, half of the steps repeat: that is the limit.
    for samples in (2, 3, 8, 20):
        share = approx([100 * (1 - 1 / samples)] * 6, abs=0.5)
        repeated = only_if(samples > 2, "velocity-held", shares_percent=share)
        yield changed(f"dq held for {samples}", repeated, dq=held(DQ, samples))
    late = np.random.default_rng(0).random(4001) < 0.6  # late packets repeat the positions too
    rows = np.maximum.accumulate(np.where(late, 0, np.arange(4001)))
    for name, q, dq in (
        ("constant speed", TURNED, RAMP),
        ("coarse speed", Q, np.round(DQ / 0.05) * 0.05),
        ("rests", np.cumsum(RESTS, axis=0) * STEP, RESTS),
        ("whole rows repeated", Q[rows], DQ[rows]),
    ):
        yield changed(name, Unsaid("velocity-held"), q=q, dq=dq)
    # 3 s at one speed, then at rest: stamps that are 30 ms off at the stop would be a lag.
    t = STEP * np.arange(400)
    way = np.cumsum(np.where(t < 3, 0.5, 0.0)) * STEP
    yield changed("one hard stop", Unsaid("velocity-lag"), t=t, q=way[:, None],
                  dq=np.where(t < 3.03, 0.5, 0.0)[:, None])  # fmt: skip
    q = 0.2 * np.clip(T[:1000] - 5.0, 0, 0.3)[:, None]
    yield changed("motion in two windows", Unsaid("velocity"), t=T[:1000], q=q,
                  dq=2 * np.gradient(q, STEP, axis=0))  # fmt: skip


def standing(x: Array, joint: int, start: float, seconds: float) -> Array:
    """A signal whose column, counted from 1, keeps one value for some time. [s]"""
    rows = (start - 1e-9 <= T) & (start + seconds + 1e-9 >= T)
    return with_column(x, x[np.argmax(rows), joint - 1], joint, rows=rows)


def of_standing() -> Iterator[Case]:
    for name, x, code in (
        ("q", Q, "position"),
        ("dq", DQ, "velocity"),
        ("torque", TORQUE, "effort"),
    ):
        for seconds in (0.45, 0.55, 20.0):
            when = {"longest_s": approx(seconds, abs=STEP), "at_s": approx(11.0, abs=STEP)}
            stuck = has_if(seconds > 0.5, f"stuck-{code}", 4, level="warning", **when)
            signals = {"q": Q, "dq": DQ, "torque": TORQUE, name: standing(x, 4, 11.0, seconds)}
            yield changed(f"{name} stands for {seconds} s", stuck, **signals)
    still = standing(standing(TORQUE, 4, 11.0, 3.0), 2, 30.0, 5.0)
    stuck = has("stuck-effort", 2, 4, signal="current", at_s=approx(30.0, abs=STEP))
    yield changed("a current stands", stuck, torque=None, current=still)
    # J4 rests in the second half, with one effort, and then an offset or noise on its velocity.
    rest = T > 19.99
    q, torque = with_column(Q, Q[1999, 3], 4, rows=rest), with_column(TORQUE, 7.0, 4, rows=rest)
    noise = np.random.default_rng(1).normal(0, 0.02, rest.sum())
    for name, speed in (("", 0.0), ("offset ", 5e-3), ("noisy ", noise)):
        yield changed(f"{name}rest", only(), q=q, dq=with_column(DQ, speed, 4, rows=rest),
                      torque=torque)  # fmt: skip
    # A simulated arm without noise turns about the vertical by a trapezoid of speed.
    torque = np.sign(RAMP) + 2 * np.round(np.gradient(RAMP, STEP, axis=0))
    yield changed("a trapezoid", Unsaid("stuck-effort"), q=TURNED, dq=RAMP, torque=torque)
    rows = np.where((np.arange(4001) >= 1500) & (np.arange(4001) < 1600), 1500, np.arange(4001))
    yield changed("a late packet", Unsaid("stuck-"), q=Q[rows], dq=DQ[rows], torque=TORQUE[rows])
    # Steps of 2 N·m of a torque that goes over 9 N·m: up to a second of one value at the turns.
    yield changed("coarse effort", Unsaid("stuck-effort"), torque=np.round(10 * np.cos(Q)) * 2)
    # A milliradian of travel is motion; the swing is 2 rad.
    travel = {"travel_mrad": approx(0.9, rel=1e-3), "level": "fact"}
    for size, joints, said in (
        (0.55e-3, (2,), only(beside="no-velocity")),
        (0.45e-3, (2,), only("still-joint", 2, beside="no-velocity")),
        (0.45e-3, (2, 6), only("still-joints", 2, 6, beside="no-velocity")),
        (0.45e-3, ALL, only("at-rest", beside="no-velocity", **travel)),
    ):
        yield changed(f"{joints} {2 * size} rad", said, q=scaled(Q, size, *joints), dq=None)


def wave(peak: float = 1.0, low: float = -1.0, run: int = 0) -> Array:
    """A signal between two extremes each of which it takes once, the upper for a run at will."""
    value = np.linspace(0.9 * low, 0.9 * peak, 200)
    value[50] = low
    value[100 : 100 + max(run, 1)] = peak
    return value


def of_clipping() -> Iterator[Case]:
    def clipped(name, there, effort, speed=1e-2, step=STEP) -> Case:
        """Whether an effort is clipped on a joint that goes so fast. [rad/s, s]"""
        t = step * np.arange(len(effort))
        q, dq = speed * t[:, None], np.full((len(t), 1), speed)
        return changed(name, has_if(there, "saturation"), t=t, q=q, dq=dq, torque=effort[:, None])

    # At 20 mrad/s 1.8 mrad in ten samples.
    for run in (1, 9, 10, 30):
        for sign in (1, -1):
            yield clipped(f"{run} at {sign}", run >= 10, sign * wave(run=run), speed=2e-2)
    # At a kilohertz ten samples are no time, a tenth of a second is: 99 samples are not, 101 are.
    for run in (98, 101):
        torque = np.cos(3e-3 * np.arange(4000))
        torque[1000 : 1000 + run] = 2.0
        yield clipped(f"{run} at 1 kHz", run > 100, torque, speed=0.5, step=1e-3)
    yield clipped("all of it", False, np.ones(200))
    yield clipped("a held joint needs one effort", False, wave(run=30), speed=0.0)
    yield clipped("scattered", False, np.where(np.arange(200) % 10, wave(), 1.0))
    # An effort that often reads the same small value rests: below half of its range.
    yield clipped("small value", False, wave(peak=0.9, low=-1.0, run=30))
    yield clipped("large value", True, wave(peak=1.1, low=-1.0, run=30))
    yield clipped("most of the time", True, np.where(np.arange(200) < 150, 1.0, wave()))
    # The top of a coarse effort is wide on the level below too: (√2 − 1) times as wide, twice.
    for step in (0.01, 0.1):
        smooth = np.round(np.sin(0.002 * np.arange(4000)) / step) * step
        yield clipped(f"coarse by {step}", False, smooth)
        yield clipped(f"coarse by {step} and clipped", True, np.clip(smooth, -0.8, 0.8))
    # From its largest value on to the end, a quarter of the log; twice there it is clipped.
    torque = with_column(TORQUE, 25.0, 4, rows=slice(3000, None))
    yield changed("stands at its extreme", only("stuck-effort"), torque=torque)
    yield changed("twice at its extreme", only("saturation", 4, level="warning", signal="current"),
                  current=with_column(torque, 25.0, 4, rows=slice(2000, 2100)))  # fmt: skip


def of_zeros() -> Iterator[Case]:
    zeros = np.zeros_like(Q)
    nearly = with_column(zeros, 1e-9, *ALL, rows=-1)
    for name in ("current", "torque"):
        for x, said in ((zeros, has("zero-effort", *ALL, level="warning", signal=name)),
                        (nearly, Unsaid("zero-effort"))):  # fmt: skip
            yield changed(f"{name} {x[-1, 0]}", said, **{"torque": None, name: x})
    for name, level in (("tau_ext", "warning"), ("wrench", "warning"), ("target_torque", "fact"),
                        ("dq", "fact")):  # fmt: skip
        code = f"zero-{name.replace('_', '-')}"
        yield changed(f"{name} is zero", has(code, level=level), **{name: zeros})
        yield changed(f"{name} is nearly zero", Unsaid(code), **{name: nearly})
    yield changed("zero wrench and torques", has("zero-wrench"), wrench=zeros, tau_ext=zeros)
    yield changed("zero wrench", has("zero-wrench-beside-tau-ext"), wrench=zeros, tau_ext=TORQUE)
    # Zero, not also stuck; on a joint at rest only where the others' noise shows a sensor.
    rest = {"q": scaled(Q, 0.0, 5), "dq": scaled(DQ, 0.0, 5)}
    yield changed("zero on J5", only("zero-effort", 5), torque=scaled(TORQUE, 0.0, 5))
    yield changed("zero at rest", has("zero-effort"), torque=scaled(TORQUE, 0.0, 5), **rest)
    yield changed("zero beside no noise", Unsaid("zero-effort"),
                  torque=scaled(20 * np.cos(Q), 0.0, 5), **rest)  # fmt: skip
    for step in (1e-4, 1e-3):
        q = Q + 0.01 * T[:, None]  # no two swings alike
        q[:, [1, 4]] = np.round(q[:, [1, 4]] / step) * step
        coarse = only_if(step == 1e-3, "coarse-positions", 2, 5, level="fact",
                         steps_mrad=approx([1e3 * step] * 2))  # fmt: skip
        yield changed(f"positions by {step}", coarse, q=q, dq=DQ + 0.01)
    # At 25 Hz every step is large, but none is a multiple of the smallest.
    yield changed("25 Hz", Unsaid("coarse-positions"), t=T[::4], q=Q[::4], dq=DQ[::4])


def straight(x: Array, every: int, bend: float = 0.0) -> Array:
    """A signal of every such sample, joined by lines whose slope changes by a share within."""
    knots = np.arange(0, len(T), every)
    lines = np.column_stack([np.interp(T, T[knots], column[knots]) for column in x.T])
    rise = np.repeat(np.diff(x[knots], axis=0), every, axis=0)
    odd = np.arange(len(rise)) % every == every // 2
    lines[:-1] += 0.5 * bend * rise / every * odd[:, None]
    return lines


RISING = (0.2 * T + 0.05 * np.sin(3.0 * T))[:, None] * np.ones(6)
EARLY = T[:, None]


def of_sizes() -> Iterator[Case]:
    for effort in ("torque", "current", "torque_without_gravity"):
        for x in (TORQUE, FRICTION):
            yield changed(f"sound {effort} {x[0, 0]:.1f}", only(), **{"torque": None, effort: x})
    yield changed("no velocity", only("no-velocity", level="warning"), dq=None)
    yield changed("no effort", only("no-effort", level="warning"), torque=None)
    for samples in (1, 2, 3):
        log = Recording(t=T[:samples], q=Q[:samples], dq=DQ[:samples])
        yield Case(f"{samples} of all samples", lambda log=log: said_of(log),
                   only("too-short", level="warning", samples=samples) if samples < 3
                   else Unsaid("too-short"))  # fmt: skip
    for peak in (12.9, 13.1, -13.1):  # two turns
        degrees = has_if(peak != 12.9, "degrees", largest_rad=approx(13.1))
        yield changed(f"a position of {peak}", degrees, q=with_column(Q, peak, 3, rows=7))
    # Wrist 3 of a UR3 has no limit: ten turns of it are 63 rad.
    for joint in (6, 5):
        yield changed(f"ten turns of J{joint}", has_if(joint == 5, "degrees"),
                      q=with_column(Q, Q[:, joint - 1] + 63.0, joint))  # fmt: skip
    for size in (59.0, 61.0):
        large = only_if(size > 60, "milliamperes", typical_A=approx(61.0, rel=2e-3))
        yield changed(f"currents of {size} A", large, current=size * FRICTION, torque=None)
    for few in (9, 11):
        current = FRICTION.copy()
        current.flat[: current.size * few // 1000] = 500.0
        yield changed(f"{few} in 1000 of 500 A", has_if(few > 10, "milliamperes"), current=current,
                      torque=None)  # fmt: skip
    way, effort = straight(Q, 4), straight(20 * Q, 4)
    holding = np.where(EARLY < 16.0, effort, 20 * held(Q, 4))
    for name, q, torque, rate in (
        ("lines of 4", way, effort, 25.0),
        ("lines of 10", straight(Q, 10), straight(20 * Q, 10), 10.0),
        ("half runs straight, less than .6", straight(Q, 2), straight(20 * Q, 2), None),
        ("lines in q", way, 20 * Q, None),
        ("lines in torque", Q, effort, None),
        ("lines that only rise or fall", straight(RISING, 10), straight(-RISING, 10), 10.0),
        ("what only rises or falls", RISING, -RISING, None),
        ("a slope alike to a thousandth", way, straight(20 * Q, 4, bend=0.5e-3), 25.0),
        ("a slope that bends", way, straight(20 * Q, 4, bend=8e-3), None),
        ("lines for 16 s, then steps, which are no motion", way, holding, 25.0),
        ("lines in less than a tenth", way, effort * (EARLY < 2.0), None),
        ("lines in more than a tenth", way, effort * (EARLY < 6.0), 25.0),
    ):
        rates = {"rate_Hz": approx(rate), "logged_Hz": approx(100.0)}
        lines = has_if(rate is not None, "interpolated", **rates)
        yield changed(name, lines, q=q, torque=torque)


CASES = (*of_clock(), *of_rows(), *of_velocity(), *of_velocity_clock(), *of_velocity_order(),
         *of_standing(), *of_clipping(), *of_zeros(),
         *of_sizes())  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_fault_is_said_beyond_its_limit_and_not_before(case):
    case.said.check(case.find())


def test_uneven_steps_shift_nothing():
    """Steps of 4 to 16 ms, stamps as exact as the signals: the lag stays below 0.1 ms."""
    t = np.cumsum(np.random.default_rng(0).uniform(0.004, 0.016, 4001))
    t -= t[0]
    fit = velocity_fit(log_of(t=t, q=np.sin(np.outer(t, RATES)), dq=speed_at(t)))
    np.testing.assert_allclose(fit.gain, 1.0, atol=1e-3)
    np.testing.assert_allclose(fit.lag, 0.0, atol=1e-4)


def test_noise_of_the_positions_hides_no_lag():
    """Noise of 1 mrad makes the derivative of the slope ten times as large as the motion's own."""
    q = Q + np.random.default_rng(0).normal(0, 1e-3, Q.shape)
    fit = velocity_fit(log_of(q=q, dq=speed_at(T - 0.03)))
    np.testing.assert_allclose(fit.lag, 0.03, atol=4 * np.max(fit.lag_error))
    assert np.max(fit.lag_error) < 2e-3


def test_the_standard_errors_are_the_scatter():
    """Of 200 noises on a quarter turn to one and a half: 1/√400 = 5 % (one sigma)."""
    chance, short = np.random.default_rng(0), {"t": T[:250], "q": Q[:250]}
    noises = chance.normal(0, 0.02, (200, 250, 6))
    fits = [velocity_fit(log_of(**short, dq=2 * DQ[:250] + noise)) for noise in noises]
    for values, errors in (("gain", "gain_error"), ("lag", "lag_error")):
        scatter = np.std([getattr(fit, values) for fit in fits], axis=0)
        stated = np.mean([getattr(fit, errors) for fit in fits], axis=0)
        np.testing.assert_allclose(stated, scatter, rtol=0.2)


@pytest.mark.parametrize("cut_off", [0.5, 1.0, 2.0])
def test_a_filter_is_distinct_from_a_delay(cut_off):
    """A first-order low-pass takes 1/(2π f_c) and a part of the size, neither clock nor unit."""
    findings = found(dq=filtered(DQ, cut_off))
    assert set(findings) == {"velocity-filtered"}
    lags = findings["velocity-filtered"].values["lags_ms"]
    # Twice a sample of the recursion, and (ωτ)² of the linear fit on the slowest joint.
    assert lags[0] == pytest.approx(1e3 / (2 * np.pi * cut_off), rel=0.12)


@pytest.mark.parametrize(
    ("changes", "codes"),
    [
        ({"t": np.append(T[:-1], 0.9e18)}, []),
        ({"t": np.append(T[:-1], 1.1e18)}, ["absurd-clock"]),
        ({"t": 1e-12 * T}, ["absurd-steps"]),
        ({"t": 1e-10 * T}, []),
        ({"t": 1.1e12 * T}, ["absurd-steps"]),
        ({"torque": 1.1e9 * DQ / DQ.max()}, ["absurd-values"]),
        ({"torque": 0.9e9 * DQ / DQ.max()}, []),
        ({"tau_ext": 1e300 * DQ, "q": 1e300 * Q, "torque": TORQUE}, ["absurd-values"] * 2),
    ],
)
def test_numbers_that_no_clock_and_no_robot_gives(changes, codes):
    """The limits are beyond every unit: 30 years in ns, steps from 0.1 ps to 300 years."""
    findings = examine(log_of(**changes)).findings
    assert [f.code for f in findings if f.code.startswith("absurd")] == codes
    if codes:
        assert len(findings) == len(codes)  # nothing else is examined
    if codes == ["absurd-clock"]:
        assert findings[0].values == {"least_s": T[0], "largest_s": 1.1e18}


def effort_of_share(share: float, *joints: int) -> Array:
    """Effort whose net work over its gross work is as given on some joints, 1 on the others.

    It drives for (1 + share)/2 of all the way and brakes for the rest.
    """
    way = np.cumsum(np.abs(DQ), axis=0) / np.sum(np.abs(DQ), axis=0)
    drives = np.where(way <= (1 + share) / 2 + 1e-9, 1.0, -1.0)
    chosen = np.isin(np.arange(6), [j - 1 for j in joints])
    return FRICTION * np.where(chosen, drives, 1.0)


def by_work(**changes: Array | None) -> list[tuple[str, tuple[int, ...], Remark]]:
    """Findings on the sign of an effort of which nobody knows the arm, with code and joints."""
    findings = inverted_effort(log_of(**changes))
    return [(finding.code, finding.where.joints, finding) for finding in findings]


@pytest.mark.parametrize(
    ("share", "joints", "code"),
    [
        (0.0, ALL, ""),
        (-0.35, ALL[:4], ""),
        (-0.45, ALL[:4], "effort-sign-by-work"),
        (-1.0, ALL, "effort-sign-by-work"),
        # of few joints less than .85 of the work may be gravity's
        (-0.8, (5,), ""),
        (-0.8, (2, 3, 5), ""),
        (-0.9, (5,), "effort-sign-of-some"),
        (-0.9, (2, 3, 5), "effort-sign-of-some"),
    ],
)
def test_an_effort_that_takes_energy_is_inverted(share, joints, code):
    said = by_work(torque=effort_of_share(share, *joints))
    assert [each[:2] for each in said] == ([(code, joints)] if code else [])
    for *_, finding in said:
        shares = pytest.approx([100 * share] * len(joints), abs=0.2)
        assert finding.values["shares_percent"] == shares


def test_joints_that_tell_nothing_are_not_judged():
    """Too little way, one direction only, no effort: each alone."""
    ways, turned = np.sum(np.abs(np.diff(Q, axis=0)), axis=0), -FRICTION
    for way, known in ((0.29, False), (0.31, True)):
        assert bool(by_work(q=Q * way / ways, torque=turned)) == known
    for slowest, known in ((0.9e-3, False), (1.1e-3, True)):
        for dq in (np.maximum(DQ, -slowest), np.minimum(DQ, slowest)):
            assert bool(by_work(dq=dq, torque=turned)) == known
    assert not by_work(torque=0 * turned)
    assert not by_work(torque=turned, dq=None)


def test_the_numbers_of_an_inverted_effort():
    turned = scaled(-3.0 * FRICTION, -1.0, 1)
    for name, unit, column in (("torque", "N·m", "tau"), ("current", "A", "current")):
        ((*_, finding),) = by_work(**{"torque": None, name: turned})
        assert finding.level == "warning"
        values = dict(finding.values)
        assert values.pop("shares_percent") == pytest.approx([-100.0] * 5)
        assert values.pop("mean") == pytest.approx(-3.0, rel=2e-3)
        words = {"signal": name, "unit": unit, "column": column}
        assert values == words | {"first": 2, "width": 6}
    assert by_work(torque=FRICTION, current=-FRICTION) == []  # torque is judged first


@pytest.mark.parametrize(
    ("judged", "least"), [(1, 2), (2, 2), (3, 2), (4, 2), (5, 3), (6, 4), (7, 4), (8, 5)]
)
def test_most_are_three_in_five_and_two_at_least(judged, least):
    """Of most joints less than half of the work tells the sign, of fewer it does not."""
    columns = np.arange(judged) % 6
    half = effort_of_share(-0.45, *ALL)[:, columns]
    for turned in range(least - 1, min(least, judged) + 1):
        effort = np.where(np.arange(judged) < turned, half, FRICTION[:, columns])
        said = by_work(q=Q[:, columns], dq=DQ[:, columns], torque=effort)
        assert [code for code, *_ in said] == ["effort-sign-by-work"] * (turned >= least)
