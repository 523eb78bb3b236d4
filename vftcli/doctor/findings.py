"""Findings: what the log doctor tells, always with evidence, consequence and remedy."""

from dataclasses import dataclass
from typing import Literal

Severity = Literal["note", "warning"]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One observation about a log.

    Attributes:
        name: Short name, as used in ``--json``.
        severity: A note informs; a warning can make results wrong and fails ``--strict``.
        evidence: What was seen, with numbers.
        consequence: What it does to the results.
        remedy: What to do about it.
    """

    name: str
    severity: Severity
    evidence: str
    consequence: str
    remedy: str

    def __str__(self) -> str:
        """The finding on one line."""
        return f"{self.name}: {self.evidence}. {self.consequence}. {self.remedy}."
