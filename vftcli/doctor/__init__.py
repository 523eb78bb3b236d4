"""The log doctor: faults of a log, their evidence, effects and remedies."""

from vftcli.doctor.examination import (
    Examination,
    Examiner,
    FindingWords,
    examine,
    finding_record,
    in_words,
)
from vftcli.doctor.fit import RobotMatch, guess_robot

__all__ = [
    "Examination",
    "Examiner",
    "FindingWords",
    "RobotMatch",
    "examine",
    "finding_record",
    "guess_robot",
    "in_words",
]
