"""Which method identifies an arm where nobody says one: links are held unless they are wrong."""

import numpy as np

from vftcli.identification.clean_fit import (
    OTHER_LINKS,
    fit_without_contacts,
    heavy_joints,
    links_explain,
    weighted_rms,
)
from vftcli.identification.friction_method import friction_method
from vftcli.identification.method_result import MethodResult
from vftcli.identification.training import Training, all_residuals
from vftcli.identification.whole_arm import whole_arm
from vftcli.signals.errors import IdentificationError
from vftcli.signals.remarks import caution

#: Share of a joint's torque that its profile's links must leave before others are sought.
MATTERS = 0.02


def chosen_method(data: Training) -> tuple[str, MethodResult]:
    """What "friction" finds, or "base" where the profile's links are not the arm's; its name.

    The links are identified too where they leave `OTHER_LINKS` times what free ones leave, the logs
    tell them, and nothing suggests a load or another arm.
    """
    fits, weights, remarks = fit_without_contacts(data, strict=True)
    kept = friction_method(data, (fits, weights, remarks))
    left = all_residuals(data, fits)
    ratios = links_explain(data, fits, left, weights)
    spread = np.std(np.concatenate([motion.tau for motion in data.motions]), axis=0)
    much = (weighted_rms(left, weights) > MATTERS * spread)[heavy_joints(data)]
    ratio = float(np.max(ratios[much], initial=0.0))
    doubted = any(remark.level == "warning" for remark in remarks)
    if ratio <= OTHER_LINKS or doubted or data.fit_constants:
        return "friction", kept
    try:
        freed = whole_arm(data)
    except IdentificationError:
        return "friction", kept
    if freed.is_narrow:
        return "friction", kept
    said = caution("links-identified", robot=data.robot.name, ratio=ratio)
    return "base", freed._replace(remarks=[said, *freed.remarks])
