"""vftcli: external forces from recorded robot logs, with their errors.

For notebooks, everything one needs is here; it is imported when it is first used::

    import vftcli as vft

    recording = vft.read("fixtures/ur5_circle.csv")
    robot = vft.load_robot("ur5")
    terms = vft.dynamics_terms(recording, robot)
    estimate = vft.MomentumObserver(gain=10.0).estimate(terms)
    estimate.tau  # (T, n) [N·m], torque on the robot
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vftcli.analysis import Analysis
    from vftcli.evaluation import evaluate, rmse
    from vftcli.observers import (
        FilteredDynamicsObserver,
        KalmanObserver,
        MomentumObserver,
        Observer,
    )
    from vftcli.pipeline import AnalysisChoice, analyse, analyse_log
    from vftcli.readers import read
    from vftcli.readers.assembly import assemble
    from vftcli.repetition.two_cycle import two_cycle_difference
    from vftcli.robots import Payload, Robot, load_robot
    from vftcli.robots.kinematics import flange_jacobian, link_poses
    from vftcli.robots.terms import DynamicsTerms, dynamics_terms
    from vftcli.signals.errors import VftError
    from vftcli.signals.external_torque import ExternalTorque
    from vftcli.signals.recording import Recording

__version__ = "0.1.0"

HOMES = {
    "Analysis": "analysis",
    "DynamicsTerms": "robots.terms",
    "ExternalTorque": "signals.external_torque",
    "FilteredDynamicsObserver": "observers",
    "KalmanObserver": "observers",
    "MomentumObserver": "observers",
    "Observer": "observers",
    "Payload": "robots",
    "Recording": "signals.recording",
    "AnalysisChoice": "pipeline",
    "Robot": "robots",
    "VftError": "signals.errors",
    "analyse": "pipeline",
    "analyse_log": "pipeline",
    "assemble": "readers.assembly",
    "dynamics_terms": "robots.terms",
    "evaluate": "evaluation",
    "flange_jacobian": "robots.kinematics",
    "link_poses": "robots.kinematics",
    "load_robot": "robots",
    "read": "readers",
    "rmse": "evaluation",
    "two_cycle_difference": "repetition.two_cycle",
}
"""Public name → the module it lives in."""


def __getattr__(name: str) -> Any:  # noqa: ANN401 - the names are of every kind
    if name not in HOMES:
        raise AttributeError(f"module 'vftcli' has no attribute {name!r}")
    return getattr(import_module(f"vftcli.{HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*HOMES, "__version__"])


__all__ = [
    "Analysis",
    "AnalysisChoice",
    "DynamicsTerms",
    "ExternalTorque",
    "FilteredDynamicsObserver",
    "KalmanObserver",
    "MomentumObserver",
    "Observer",
    "Payload",
    "Recording",
    "Robot",
    "VftError",
    "analyse",
    "analyse_log",
    "assemble",
    "dynamics_terms",
    "evaluate",
    "flange_jacobian",
    "link_poses",
    "load_robot",
    "read",
    "rmse",
    "two_cycle_difference",
]
