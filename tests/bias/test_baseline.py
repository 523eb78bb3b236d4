"""A log's free part and spectra: what counts as free, and whose gains they are."""

from dataclasses import replace
from pathlib import Path

from vftcli.bias.baseline import Baselines, baseline_of
from vftcli.free_motion import FreeChoice
from vftcli.free_motion.free_motion import FreeMotion
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.run import Run

LOG = read(Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv")


def test_a_log_without_a_free_part_says_why() -> None:
    own = Run(recording=LOG.between(4.5, 6.0), robot=load_robot("ur5"))
    found = baseline_of(FreeMotion(log=own))
    assert (found.part, found.spectra, found.pieces) == (None, None, ())
    assert found.missing.code == "no-free-part"
    assert "no repetition found" in found.missing.values["reason"]
    assert found.remarks == (found.missing,)


def test_gains_come_from_the_spectra_where_they_are_asked_for() -> None:
    own = Run(recording=LOG.between(0.0, 10.0), robot=load_robot("ur5"))
    found = baseline_of(FreeMotion(log=own, choice=FreeChoice(spans=((0.0, 4.0),))))
    blind = replace(found, spectra=None)
    assert Baselines(plain=found, best=blind).spectra(gains=True).gains
    assert Baselines(plain=found, best=blind).spectra(gains=False) == (found.spectra, None, None)
    assert Baselines(plain=blind, best=found).spectra(gains=True) == (None, found.spectra, None)
