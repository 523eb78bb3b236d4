"""From what was found to rows."""

import numpy as np
import polars as pl
import pytest
from contact_logs import FIXTURES, motion
from contact_rows import contact
from drawn_blocks import blocks, drawn, noise

from vftcli.contacts.listing import list_contacts
from vftcli.contacts.rows import (
    ContactLocation,
    force_course,
    sensor_force,
    shows_force,
    vendor_force,
)
from vftcli.contacts.windows import PointFit, quiet_error
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.run import Run
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import WrenchFrame
from vftcli.wrench.model_error import error_process
from vftcli.wrench.smoother import hidden_by_blocks


@pytest.mark.parametrize(
    ("force", "evidence", "smallest", "shows"),
    [
        (31.0, 13.0, 40.0, True),  # beyond its band
        (29.0, 119.0, 2.0, False),
        (29.0, None, 2.0, False),
        (29.0, 121.0, 28.0, True),  # sure, and more than free motion reads
        (29.0, 9e5, 30.0, False),
        (29.0, 121.0, np.nan, True),  # nothing says what free motion reads
    ],
)
def test_a_force_within_its_band_needs_evidence_and_what_shows(force, evidence, smallest, shows):
    row = contact(peak_force=force, peak_band=90.0, place_band=30.0, evidence=evidence)
    assert shows_force(row, smallest) == shows


def test_the_error_is_bridged_across_a_contact_as_a_dense_solve_does():
    d = drawn(60, np.random.default_rng(8))
    log = blocks(d, np.full_like(d, 0.5))
    hidden = (np.arange(60) > 20) & (np.arange(60) < 30)
    mean, variance = quiet_error(d, error_process(noise(), log).hiding(hidden))
    known = ~hidden
    prior = 0.25 * np.exp(-np.abs(log.t[:, None] - log.t) / 0.4)
    S = prior[known][:, known] + 0.01 * np.eye(known.sum())
    gain = np.linalg.solve(S, prior[known]).T
    # What is hidden still has a variance, 1e9 (N·m)²: it tells a part in 1e9.
    np.testing.assert_allclose(mean[:, 0], gain @ d[known, 0], atol=1e-7)
    exact = np.diag(prior - gain @ prior[known])
    np.testing.assert_allclose(variance[:, 0], exact, rtol=1e-7)


def still(**signals: object) -> Run:
    """A UR5 that holds a pose for a second, with further signals."""
    t = 0.01 * np.arange(100)
    q = np.tile([0.3, -1.2, 1.6, -1.9, -1.4, 0.5], (100, 1))
    recording = Recording(t=t, q=q, dq=np.zeros_like(q), torque=np.zeros_like(q), **signals)
    return Run(recording=recording, robot=load_robot("ur5"))


def test_the_logs_own_torque_and_wrench_are_forces_beside_a_row():
    plain = still()
    J = flange_jacobian(plain.robot.chain, plain.recording.q)[0]
    torque = np.tile(J.T @ [3.0, 4.0, 12.0, 0.0, 0.0, 0.0], (100, 1))
    assert vendor_force(still(tau_ext=torque), J, 0.5) == pytest.approx(13.0)
    wrench = np.tile([3.0, 4.0, 12.0, 1.0, 1.0, 1.0], (100, 1))
    reported = still(wrench=wrench, wrench_frame=WrenchFrame("sensor", "sensor"))
    assert sensor_force(reported, 0.5) == pytest.approx(13.0)
    assert vendor_force(plain, J, 0.5) is sensor_force(plain, 0.5) is None
    # A field that the log's writer left at zero measures nothing.
    assert sensor_force(still(wrench=0.0 * wrench), 0.5) is None


def test_a_row_on_a_link_has_its_moment_about_the_flange():
    """A fixture's rows: what joints 1 to 6 feel is Jᵀ of the wrench at the flange."""
    recording = read(FIXTURES / "ur5_taps_ur_rtde.csv")
    truth = pl.read_parquet(FIXTURES / "ur5_taps_ur_rtde.csv.truth.parquet")
    t = truth["t"].to_numpy() - recording.source.t0
    wrench = truth.select("^wrench/.*$").to_numpy()
    found = list_contacts(motion(recording, "ur5", "0.3:4"))
    assert [row.number for row in found.contacts] == [1, 2]
    assert (found.duration, found.basis, found.stops) == (6.0, "free motion", ())
    for row in found.contacts:
        q = np.array([np.interp(row.peak, recording.t, column) for column in recording.q.T])
        J = flange_jacobian(load_robot("ur5").chain, q[None])[0]
        np.testing.assert_allclose(J.T @ row.wrench, row.joint_torque, atol=1e-9)
        assert row.start < row.peak < row.stop
        assert (row.where, row.places, row.trust, row.at_rest) == ("wrist", (0, 6), "good", False)
        assert (row.vendor_force, row.sensor_force, row.remarks) == (None, None, ())
        # Truth of the simulation: two standard deviations at the peak, a twentieth of ∫F dt.
        true = wrench[np.argmin(abs(t - row.peak))]
        assert np.all(abs(row.wrench - true) < 1.96 * row.wrench_sd)
        assert np.all(row.wrench_sd < [7.0, 7.0, 7.0, 1.5, 1.5, 1.5])
        pushed = 0.008 * wrench[(t > row.start - 0.1) & (t < row.stop + 0.1), :3].sum(axis=0)
        np.testing.assert_allclose(row.impulse, pushed, atol=0.05 * np.linalg.norm(pushed))
        np.testing.assert_allclose(row.impulse, row.mean_force * (row.stop - row.start))
        # The wrist alone fits: no other place changes the size.
        size, band = np.linalg.norm(row.wrench[:3]), row.place_band
        assert (row.peak_force, row.peak_band) == pytest.approx((size, band))
        assert row.anywhere == pytest.approx((size - band, size + band))
        course = row.course
        assert row.start <= course.t[0] < course.t[-1] <= row.stop
        top = course.force.argmax()
        highest = course.t[top], course.force[top], course.band[top]
        assert highest == pytest.approx((row.peak, row.peak_force, row.place_band))
    # The first lasts 4.560 to 4.792 s and has 75.2 N in truth. In blocks of 8 ms that is found to
    # half a block of 24 ms, which would cut its peak to 71.8 N; the band is that of a longer push.
    tap, _ = found.contacts
    assert np.diff(tap.course.t) == pytest.approx(0.008)
    assert (tap.start, tap.stop) == pytest.approx((4.560, 4.792), abs=0.012)
    assert tap.peak_force == pytest.approx(75.2, abs=1.5)
    assert 5.0 < tap.peak_band < 12.0


def test_a_size_is_as_sure_as_its_place():
    def fit(link: int, size: float, score: float, share: float = 0.5) -> PointFit:
        force = np.array([size, 0.0, 0.0])
        return PointFit(link, share, misfit=0.0, score=score, size=size, force=force, band=1.0)

    alike = ContactLocation([fit(5, 40.0, 1.0), fit(4, 60.0, 1.0)], 6, ())
    assert alike.spread(40.0) == 0.0  # both on the wrist, whose wrench holds them
    apart = ContactLocation([fit(5, 40.0, 1.0), fit(3, 60.0, 1.0)], 6, ())
    assert apart.spread(40.0) == pytest.approx(20.0 / np.sqrt(2.0))
    assert apart.links == (3, 5)
    assert (apart.sizes(40.0, 5.0), apart.sizes(0.5, 5.0)) == ((35.0, 61.0), (0.0, 61.0))
    tip = ContactLocation([fit(6, 40.0, 1.0, share=1.0), fit(3, 40.0, 1.0, 1.0)], 6, ())
    assert tip.links == (0, 3)  # the last link's end is the flange, and that of no other
    # Four in the score are e⁻² in likelihood.
    less = ContactLocation([fit(5, 40.0, 1.0), fit(3, 60.0, 5.0)], 6, ())
    assert less.spread(40.0) == pytest.approx(20.0 * np.sqrt(np.exp(-2) / (1 + np.exp(-2))))


def test_where_no_point_force_fits_the_links_are_those_that_a_moment_may_have_touched():
    """A χ² beyond 20 is no point force: its size at other places says nothing either."""
    force = np.array([60.0, 0.0, 0.0])
    odd = PointFit(3, 0.5, misfit=21.0, score=30.0, size=60.0, force=force, band=1.0)
    pushed = ContactLocation([odd], 6, (0, 6))
    assert (pushed.links, pushed.on_wrist, pushed.spread(40.0)) == ((0, 6), True, 0.0)
    assert pushed.sizes(40.0, 5.0) == (35.0, 45.0)
    fits = ContactLocation([odd._replace(misfit=19.0)], 6, (0, 6))
    assert (fits.links, fits.sizes(40.0, 5.0)) == ((3,), (35.0, 61.0))


def test_a_course_bears_the_band_along_its_force():
    t = np.array([1.0, 2.0])
    force = np.array([[3.0, 4.0, 0.0], [0.0, 0.0, 0.0]])
    covariance = np.tile(np.diag([4.0, 9.0, 25.0]), (2, 1, 1))
    course = force_course(t, force, covariance)
    assert course.force.tolist() == [5.0, 0.0]
    # u = (.6, .8, 0): √(.36·4 + .64·9) = 2.683; without a force there is no direction.
    assert course.band.tolist() == pytest.approx([1.96 * 2.6833, 0.0], rel=1e-4)
    # 3 % of 5 N, which the drives' constants may be off.
    drives = hidden_by_blocks(force, bent=0.0)
    wider = force_course(t, force, covariance + drives).band[0]
    assert wider == pytest.approx(1.96 * np.hypot(2.6833, 0.15), rel=1e-4)
