"""A row of a list of contacts, for the tests that show one."""

import numpy as np

from vftcli.contacts.contact_list import Contact, ContactList, ContactModel
from vftcli.signals.remarks import caution, fact
from vftcli.wrench.smoother import WrenchPrior


def contact(**changed: object) -> Contact:
    """A push of 65 N on the wrist."""
    values: dict[str, object] = {
        "number": 1, "start": 4.602, "stop": 4.781, "peak": 4.69,
        "peak_force": 64.8, "peak_band": 7.1, "place_band": changed.get("peak_band", 7.1),
        "wrench": np.array([0.4, 51.9, -38.8, 0.2, 0.1, 0.0]),
        "wrench_sd": np.array([1.9, 3.1, 2.8, 0.5, 0.5, 0.5]),
        "mean_force": np.array([0.3, 32.0, -24.0]),
        "impulse": np.array([0.1, 5.6, -4.1]),
        "anywhere": (57.0, 78.0), "where": "wrist", "lead": 44.0, "places": (0, 5, 6),
        "evidence": 412.0, "joint_torque": np.arange(6.0), "joint_torque_sd": np.ones(6),
        "at_rest": False,
    }  # fmt: skip
    return Contact(**(values | changed))


def contact_list(*contacts: Contact, **changed: object) -> ContactList:
    values: dict[str, object] = {
        "recording": "log.csv", "duration": 20.0, "contacts": contacts, "basis": "free motion",
        "free": (fact("free-span", begin_s=0.3, end_s=4.0),), "free_seconds": 3.7,
        "false_on_free": 0, "threshold": 12.0, "smallest_force": 6.5, "stops": (17.9,),
        "model": ContactModel(
            prior=WrenchPrior(0.3, 31.0, 1.0), noise_sd=np.ones(6), error_sd=np.ones(6),
            error_time=np.ones(6), block=0.024,
        ),
        "remarks": (caution("arm-stopped-abruptly", at_s=17.9),),
    }  # fmt: skip
    return ContactList(**(values | changed))
