"""vftcli: external forces from recorded robot logs, with their errors.

For notebooks, everything one needs is here; it is imported when it is first used::

    import vftcli as vft

    analysis = vft.report("fixtures/ur5_circle.csv", "ur5", reference="two-cycle")
    analysis.contacts.to_polars()  # what touched the arm
    analysis.wrench.to_polars()  # force and moment on the robot
    analysis.errors, analysis.remarks

One observer alone::

    terms = vft.dynamics_terms(vft.read("fixtures/ur5_circle.csv"), vft.load_robot("ur5"))
    vft.MomentumObserver(gain=10.0).estimate(terms).tau  # (T, n) [N·m], torque on the robot

What a command's further options say is a choice of each room::

    choice = vft.AnalysisChoice(
        robot=vft.RobotChoice(name="ur5"),
        observers=vft.ObserverChoice(names=("gmo", "rts-auto")),
        reference=vft.ReferenceChoice(name="two-cycle"),
    )
    vft.analyse_log("fixtures/ur5_circle.csv", choice).errors
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from vftcli.signals.version import VERSION

if TYPE_CHECKING:
    from vftcli.analysis import Analysis
    from vftcli.evaluation import evaluate, rmse
    from vftcli.evaluation.reference_choice import ReferenceChoice
    from vftcli.notebook import contacts, report, thresholds
    from vftcli.observers import (
        FilteredDynamicsObserver,
        KalmanObserver,
        MomentumObserver,
        Observer,
    )
    from vftcli.observers.choice import ObserverChoice
    from vftcli.pipeline import AnalysisChoice, analyse, analyse_log
    from vftcli.readers import read
    from vftcli.readers.reader import ReadChoice
    from vftcli.readers.reading import assemble
    from vftcli.refinement.choice import RefinementChoice
    from vftcli.repetition.choice import FreeChoice
    from vftcli.repetition.two_cycle import two_cycle_difference
    from vftcli.robots import Payload, Robot, load_robot
    from vftcli.robots.chain import flange_jacobian, link_poses
    from vftcli.robots.choice import RobotChoice
    from vftcli.robots.terms import DynamicsTerms, dynamics_terms
    from vftcli.signals.errors import VftError
    from vftcli.signals.recording import Recording
    from vftcli.signals.wrench import ExternalTorque
    from vftcli.virtual_sensor.choice import WrenchChoice, ZeroChoice

__version__ = VERSION

#: Public name → the module it lives in.
HOMES = {
    "Analysis": "analysis",
    "AnalysisChoice": "pipeline",
    "DynamicsTerms": "robots.terms",
    "ExternalTorque": "signals.wrench",
    "FilteredDynamicsObserver": "observers",
    "FreeChoice": "repetition.choice",
    "KalmanObserver": "observers",
    "MomentumObserver": "observers",
    "Observer": "observers",
    "ObserverChoice": "observers.choice",
    "Payload": "robots",
    "ReadChoice": "readers.reader",
    "Recording": "signals.recording",
    "ReferenceChoice": "evaluation.reference_choice",
    "RefinementChoice": "refinement.choice",
    "Robot": "robots",
    "RobotChoice": "robots.choice",
    "VftError": "signals.errors",
    "WrenchChoice": "virtual_sensor.choice",
    "ZeroChoice": "virtual_sensor.choice",
    "analyse": "pipeline",
    "analyse_log": "pipeline",
    "assemble": "readers.reading",
    "contacts": "contacts",
    "dynamics_terms": "robots.terms",
    "evaluate": "evaluation",
    "flange_jacobian": "robots.chain",
    "link_poses": "robots.chain",
    "load_robot": "robots",
    "read": "readers",
    "report": "notebook",
    "rmse": "evaluation",
    "thresholds": "notebook",
    "two_cycle_difference": "repetition.two_cycle",
}


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
    "FreeChoice",
    "KalmanObserver",
    "MomentumObserver",
    "Observer",
    "ObserverChoice",
    "Payload",
    "ReadChoice",
    "Recording",
    "ReferenceChoice",
    "RefinementChoice",
    "Robot",
    "RobotChoice",
    "VftError",
    "WrenchChoice",
    "ZeroChoice",
    "analyse",
    "analyse_log",
    "assemble",
    "contacts",
    "dynamics_terms",
    "evaluate",
    "flange_jacobian",
    "link_poses",
    "load_robot",
    "read",
    "report",
    "rmse",
    "thresholds",
    "two_cycle_difference",
]
