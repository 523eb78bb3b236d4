"""vftcli: external forces from recorded robot logs, with their errors.

For notebooks, one call a question; everything is imported when it is first used::

    import vftcli as vft

    analysis = vft.report("fixtures/ur5_circle.csv", "ur5", reference="two-cycle")
    analysis.contacts.to_polars()  # what touched the arm
    analysis.wrench.to_polars()  # force and moment on the robot
    analysis.errors, analysis.remarks
    analysis.plot("torques")  # a matplotlib figure

One observer alone::

    run = vft.Run(recording=vft.read("fixtures/ur5_circle.csv"), robot=vft.load_robot("ur5"))
    vft.MomentumObserver(gain=10.0).estimate(run).tau  # (T, n) [N·m], torque on the robot
"""

from typing import TYPE_CHECKING

from vftcli.signals.packages import VERSION, door

if TYPE_CHECKING:
    from vftcli.analysis import Analysis
    from vftcli.evaluation.errors import evaluate, rmse
    from vftcli.notebook import (
        admit,
        compare,
        contacts,
        estimate,
        identify,
        inspect,
        report,
        simulate,
        thresholds,
    )
    from vftcli.observers import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
    from vftcli.readers.reading import read
    from vftcli.robots import Payload, Robot, load_robot
    from vftcli.robots.chain import flange_jacobian, link_poses
    from vftcli.robots.run import Run
    from vftcli.signals.errors import VftError
    from vftcli.signals.external_torque import DynamicsTerms
    from vftcli.signals.recording import Recording
else:
    #: Modules in which a public name is looked for, quick ones first.
    __getattr__ = door(
        __name__,
        "signals.errors",
        "signals.recording",
        "signals.external_torque",
        "robots",
        "readers.reading",
        "robots.run",
        "robots.chain",
        "observers",
        "evaluation.errors",
        "analysis",
        "notebook",
    )

__version__ = VERSION

__all__ = [
    "Analysis", "DynamicsTerms", "ExternalTorque", "FilteredDynamicsObserver", "KalmanObserver",
    "MomentumObserver", "Payload", "Recording", "Robot", "Run", "VftError", "admit", "compare",
    "contacts", "estimate", "evaluate", "flange_jacobian", "identify", "inspect", "link_poses",
    "load_robot", "read", "report", "rmse", "simulate", "thresholds",
]  # fmt: skip


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
