"""Findings: the doctor's remarks with evidence, consequence and remedy."""

from collections.abc import Iterable
from typing import Any, NamedTuple

from vftcli.signals.remarks import Remark, Where, as_record, filled, sentence, words


class FindingWords(NamedTuple):
    """Text of a finding."""

    name: str  #: Short name; variants of one finding share it.
    severity: str  #: A note informs; a warning can make results wrong and fails ``--strict``.
    evidence: str  #: What was seen, with numbers.
    consequence: str  #: What it does to the results.
    remedy: str  #: What to do about it.

    def __str__(self) -> str:
        """The finding on one line."""
        parts = (self.evidence, self.consequence, self.remedy)
        return f"{self.name}: {'. '.join(part for part in parts if part)}."


def in_words(finding: Remark) -> FindingWords:
    """A finding's words, its numbers filled in."""
    entry = words(finding.code)
    return FindingWords(
        name=entry.get("name", finding.code),
        severity="warning" if finding.level == "warning" else "note",
        evidence=sentence(finding),
        consequence=filled(entry.get("consequence", ""), finding),
        remedy=filled(entry.get("remedy", ""), finding),
    )


def finding_record(finding: Remark) -> dict[str, Any]:
    """A finding for machines: its code and values, and its words."""
    said = in_words(finding)
    return {**as_record(finding), **said._asdict(), "message": str(said)}


def on_joints(joints: Iterable[int]) -> Where:
    """The place of a finding about some joints, given by their index from zero."""
    return Where(joints=tuple(int(j) + 1 for j in joints))
