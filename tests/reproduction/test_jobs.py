"""Each experiment runs once a seed, whoever shows it; what fails is a line."""

import pytest

from vftcli.reproduction.experiments import experiments_of, gather, run_jobs
from vftcli.reproduction.paper import CORRECTED, PAPERS
from vftcli.signals.progress import heard_by

HUANG = PAPERS["huang2025"]


def test_items_share_their_runs() -> None:
    """Table I and Fig. 3 are one circle a seed."""
    circle, time = experiments_of(HUANG, ("table1", "fig3", "table2"), fast=False)
    assert [circle, time] == [HUANG.experiments[name] for name in ("circle", "time")]
    # An experiment that states no seeds of its own has five.
    (twist,) = experiments_of(HUANG, ("fig9",), fast=False)
    assert twist.seeds == (1, 2, 3, 4, 5)


def test_fast_takes_the_first_seed_of_each() -> None:
    found = experiments_of(HUANG, tuple(HUANG.items), fast=True)
    first = {name: e.seeds[:1] for name, e in HUANG.experiments.items()}
    assert {e.name: e.seeds for e in found} == first
    assert experiments_of(HUANG, ("fig1",), fast=True) == []


def test_what_fails_is_a_line_and_the_rest_is_there(cheap) -> None:
    experiments, reported = experiments_of(cheap, tuple(cheap.items), fast=False), []
    with heard_by(lambda *words: reported.append(words)):
        results = run_jobs(experiments, workers=0)
    assert [name for name, _ in results] == ["works"] * 3 + ["fails"] * 2 + ["timed"]
    # What takes the time has the machine for itself.
    assert reported[-1] == ("6 of 6 runs done: timed, seed 0", 1.0)
    found = gather(cheap, tuple(cheap.items), results)
    assert found["fig1"].values["a"][CORRECTED] == [3.0, 4.0, 5.0]
    assert found["fig1"].values["b"][CORRECTED] == [-1.0, None, None]
    assert found["fig1"].chart is not None
    failed = [f"what fails, seed {k}: nothing moved with {k}" for k in (1, 2)]
    assert found["fig3"].failures == failed
    assert found["fig3"].values["a"][CORRECTED] == [2.0]
    assert found["fig2"].values == {}
    (_, first), (_, second), *_ = results
    assert ("", "fig1") in first
    assert (CORRECTED, "a") in second
    assert ("", "fig1") not in second  # only the first seed's traces are shown


@pytest.mark.slow
def test_numbers_do_not_depend_on_how_many_run_at_once() -> None:
    experiments = [HUANG.experiments[name] for name in ("release-ur5", "release-panda")]
    one, two = (run_jobs(experiments, workers=n) for n in (0, 2))
    assert one == two
