"""Runs of terms that a test makes itself, without a motion behind them; analyses, commands."""

from pathlib import Path

import numpy as np
from typer.testing import CliRunner

from vftcli.analysis import Analysis
from vftcli.cli import make_app
from vftcli.pipeline import AnalysisChoice, analyse_logs
from vftcli.robots import load_robot
from vftcli.robots.robot import Robot
from vftcli.robots.run import Run, RunSamples
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.recording import Recording


def run_of(terms: DynamicsTerms, q: Array | None = None, robot: Robot | None = None) -> Run:
    """A run with these terms, at positions q (T, n) [rad] or at rest in zero."""
    places = np.zeros_like(terms.p) if q is None else q
    log = Recording(t=terms.t, q=places)
    return Run(recording=log, robot=robot or load_robot("ur5")).holding(terms=terms)


def samples_of(terms: DynamicsTerms, inside: Mask, q: Array | None = None) -> RunSamples:
    return RunSamples(run_of(terms, q), inside)


def analyse_log(log: Path, choice: AnalysisChoice) -> Analysis:
    return next(analyse_logs([log], choice))


def command(*words: object) -> str:
    """What a command prints on stdout; its error is raised."""
    done = CliRunner().invoke(make_app(), [str(word) for word in words], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout
