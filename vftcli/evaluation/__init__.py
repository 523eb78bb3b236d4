"""Evaluation: errors of estimates against a reference, with intervals, lags and significance."""

from typing import TYPE_CHECKING

from vftcli.signals.packages import door

if TYPE_CHECKING:
    from vftcli.evaluation.errors import SCHEMA, correlation, evaluate, evaluate_pooled, rmse
    from vftcli.evaluation.intervals import paired_significance
    from vftcli.evaluation.wrenches import (
        WRENCH_SCHEMA,
        evaluate_wrenches,
        with_contacts,
    )
else:
    __getattr__ = door(__name__, "errors", "intervals", "wrenches")

__all__ = [
    "SCHEMA",
    "WRENCH_SCHEMA",
    "correlation",
    "evaluate",
    "evaluate_pooled",
    "evaluate_wrenches",
    "paired_significance",
    "rmse",
    "with_contacts",
]
