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
        ({"inferred": True}, "fair"),
        ({"peak_band": 0.5 * 64.8, "place_band": 7.1}, "fair"),
    ],
)
def test_trust_goes_by_evidence_band_and_remarks(changed: dict[str, object], trust: str) -> None:
    assert contact(**changed).trust == trust


def test_no_size_by_velocities_in_doubt_is_good() -> None:
    found = contact_list(contact(), contact(number=2))
    assert [row.trust for row in found.weighed(None, doubted=False)] == ["good", "good"]
    assert [row.trust for row in found.weighed(None, doubted=True)] == ["weak", "weak"]


def test_the_hardest_is_the_one_with_the_largest_force() -> None:
    soft, hard = contact(peak_force=10.0), contact(number=2, peak_force=80.0)
    assert contact_list(soft, hard).hardest is hard
    assert contact_list().hardest is None


def test_a_force_within_its_band_is_the_hardest_only_among_its_like() -> None:
    wide, sized = contact(peak_force=88.0, peak_band=170.0), contact(peak_force=10.0)
    assert contact_list(wide, sized).hardest is sized
    assert contact_list(wide).hardest is wide
    assert (wide.size_known, sized.size_known) == (False, True)


def test_a_row_without_a_size_needs_sure_evidence() -> None:
    assert contact(peak_force=2.0, peak_band=3.0).is_told
    assert not contact(peak_force=2.0, peak_band=3.0, evidence=49.0).is_told
    assert not contact(peak_force=2.0, peak_band=3.0, evidence=None).is_told
    assert contact(peak_force=None, peak_band=None, evidence=None).is_told


def test_a_size_that_depends_on_an_unknown_place_is_unknown() -> None:
    by_place = caution("size-goes-with-place", least_N=20.0, most_N=248.0)
    unknown = contact(remarks=(by_place,), peak_force=70.0)
    assert not unknown.size_known
    assert unknown.trust == "weak"
    # One whose size is known goes before a larger one whose size is not.
    sized = contact(number=2)
    assert contact_list(unknown, sized).hardest is sized


@pytest.mark.parametrize(("least", "told"), [(6.5, 6.5), (3473.0, None), (None, None)])
def test_a_pose_that_is_blind_along_an_axis_tells_no_least_force(
    least: float | None, told: float | None
) -> None:
    assert contact_list(smallest_force=least).detectable_force == told
    assert contact_list(smallest_force=float("nan")).detectable_force is None
