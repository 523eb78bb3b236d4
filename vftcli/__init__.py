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
    from vftcli.dynamics.kinematics import flange_jacobian, link_poses
    from vftcli.dynamics.terms import DynamicsTerms, dynamics_terms
    from vftcli.errors import VftError
    from vftcli.evaluation import evaluate, rmse
    from vftcli.observers import (
        FilteredDynamicsObserver,
        KalmanObserver,
        MomentumObserver,
        Observer,
    )
    from vftcli.pipeline import Request, analyse, analyse_log
    from vftcli.readers import read
    from vftcli.readers.assembly import assemble
    from vftcli.recording import Recording
    from vftcli.robots import Payload, Robot, load_robot
    from vftcli.torque import ExternalTorque
    from vftcli.truth.two_cycle import two_cycle_difference

__version__ = "0.1.0"

HOMES = {
    "Analysis": "analysis",
    "DynamicsTerms": "dynamics.terms",
    "ExternalTorque": "torque",
    "FilteredDynamicsObserver": "observers",
    "KalmanObserver": "observers",
    "MomentumObserver": "observers",
    "Observer": "observers",
    "Payload": "robots",
    "Recording": "recording",
    "Request": "pipeline",
    "Robot": "robots",
    "VftError": "errors",
    "analyse": "pipeline",
    "analyse_log": "pipeline",
    "assemble": "readers.assembly",
    "dynamics_terms": "dynamics.terms",
    "evaluate": "evaluation",
    "flange_jacobian": "dynamics.kinematics",
    "link_poses": "dynamics.kinematics",
    "load_robot": "robots",
    "read": "readers",
    "rmse": "evaluation",
    "two_cycle_difference": "truth.two_cycle",
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
    "DynamicsTerms",
    "ExternalTorque",
    "FilteredDynamicsObserver",
    "KalmanObserver",
    "MomentumObserver",
    "Observer",
    "Payload",
    "Recording",
    "Request",
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
