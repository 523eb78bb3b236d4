"""Terms and estimates of a few samples, by hand."""

import re

import numpy as np

from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque, one_sample_earlier

T = np.array([1.0, 1.1, 1.3, 1.4])
P = np.array([[0.0, 5.0], [1.0, 5.5], [3.0, 4.0], [2.0, 4.5]])
MU = np.array([[2.0, 0.0], [4.0, 10.0], [6.0, 30.0], [1.0, 50.0]])
D = [[0.0, 0.0], [0.7, 0.0], [1.0, -5.5], [-1.35, -3.5]]
"""Δp − ½Ts(μ + μ before): of the third sample 2 − ½·.2·(6 + 4), and −1.5 − ½·.2·(30 + 10)."""


def test_what_the_model_leaves_of_the_momentum_is_the_same_in_blocks() -> None:
    whole = DynamicsTerms(t=T, p=P, mu=MU)
    np.testing.assert_allclose(whole.d, D, atol=1e-15)
    # The first step is the usual one, the median of .1, .2 and .1 s.
    np.testing.assert_allclose(whole.dt, [[0.1], [0.1], [0.2], [0.1]])
    assert (whole.samples, whole.joints) == (4, 2)
    first = DynamicsTerms(t=T[:2], p=P[:2], mu=MU[:2], log_clock=whole.clock)
    rest = DynamicsTerms(t=T[2:], p=P[2:], mu=MU[2:], log_clock=whole.clock, before=first.last)
    np.testing.assert_allclose(np.vstack([first.d, rest.d]), D, atol=1e-15)
    np.testing.assert_allclose(rest.dt, [[0.2], [0.1]])
    for name, values in (("p", P), ("mu", MU)):
        earlier = values[[0, 0, 1, 2]]
        np.testing.assert_array_equal(one_sample_earlier(whole, name), earlier)
        np.testing.assert_array_equal(one_sample_earlier(rest, name), earlier[2:])
    even = DynamicsTerms(t=0.1 * np.arange(4), p=P, mu=MU)
    np.testing.assert_allclose(even.dt, [[0.1]])
    np.testing.assert_allclose(even.d[2], [1.5, -3.5])


def test_an_estimate_shows_the_sizes_of_what_is_known() -> None:
    tau = np.array([[3.0, np.nan], [-5.0, np.nan], [4.0, np.nan], [np.nan, np.nan]])
    made = ExternalTorque(name="gmo", t=T, tau=tau, error_sd=np.full((4, 2), 0.5))
    # √(50/3) = 4.082, and 1.96 · .5
    assert re.findall("<td>(.*?)</td>", made._repr_html_()) == [
        "J1", "4.082", "5", "0.98", "75%", "J2", "–", "–", "–", "0%"
    ]  # fmt: skip
    assert repr(made) == "<ExternalTorque of gmo: rms 4.082 0 N·m over 4 samples>"
    columns = {name: values.tolist() for name, values in made.columns(slice(1, 3))}
    assert list(columns) == ["tau_ext/gmo/1", "tau_ext/gmo/2", "band/gmo/1", "band/gmo/2"]
    assert columns["tau_ext/gmo/1"] == [-5.0, 4.0]
