"""The log doctor: what is wrong with a log, how one sees it, what it does, what to do."""

from vftcli.doctor.examination import Examination, Examiner, examine
from vftcli.doctor.findings import FindingWords, finding_record, in_words
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
