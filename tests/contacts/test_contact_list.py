"""Contact and ContactList."""

import pytest
from contact_rows import contact, contact_list

from vftcli.signals.remarks import caution


@pytest.mark.parametrize(
    ("changed", "trust"),
    [
        ({}, "good"),
        ({"evidence": 49.0}, "weak"),
        ({"peak_band": 0.3 * 64.8}, "fair"),
        ({"peak_band": 0.5 * 64.8}, "weak"),
        ({"remarks": (caution("free-part-rests"),)}, "weak"),
        ({"is_load": True}, "weak"),
        ({"peak_force": None}, "weak"),
    ],
)
def test_trust_goes_by_evidence_band_and_remarks(changed: dict[str, object], trust: str) -> None:
    assert contact(**changed).trust == trust


def test_the_hardest_is_the_one_with_the_largest_force() -> None:
    soft, hard = contact(peak_force=10.0), contact(number=2, peak_force=80.0)
    assert contact_list(soft, hard).hardest is hard
    assert contact_list().hardest is None
    assert contact(peak_force=None).numbered(3).number == 3
