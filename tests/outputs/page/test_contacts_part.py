from dataclasses import replace

import numpy as np
import pytest

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact, ContactList
from vftcli.outputs.page.contacts_part import (
    belief_words,
    contact_details,
    contact_row,
    contact_table,
    headline,
    lead,
    listed,
    model_pairs,
    reason,
    where_words,
)
from vftcli.signals.remarks import caution


@pytest.fixture
def found(pushed: Analysis) -> ContactList:
    assert pushed.contacts is not None
    return pushed.contacts


def bare(contact: Contact) -> Contact:
    """The row of an arm whose joints tell no force."""
    return replace(contact, peak_force=None, peak_band=None, wrench=None, anywhere=None)


def sized(contact: Contact, force: float, band: float, **rest: object) -> Contact:
    return replace(contact, peak_force=force, peak_band=band, place_band=band, **rest)


@pytest.mark.parametrize(
    ("count", "words"),
    [
        (0, "Nothing touched the arm, as far as this log shows."),
        (1, "Something pushed the arm once, with 90 ± 7 N."),
        (2, "Something pushed the arm twice, hardest with 90 ± 7 N."),
        (4, "Something pushed the arm four times, hardest with 90 ± 7 N."),
        (12, "Something pushed the arm 12 times, hardest with 90 ± 7 N."),
    ],
)
def test_the_headline_counts(found: ContactList, count: int, words: str) -> None:
    contacts = [sized(contact, 50.0, 9.0) for contact in found.contacts]
    contacts[0] = sized(contacts[0], 90.2, 6.7)
    assert headline(replace(found, contacts=tuple(contacts[:count]))) == words


def test_the_headline_is_no_force_within_its_band(found: ContactList) -> None:
    wide, sized_one = sized(found.contacts[0], 88.0, 170.0), sized(found.contacts[1], 30.0, 14.0)
    both = replace(found, contacts=(wide, sized_one))
    assert headline(both) == (
        "Something may have pushed the arm twice, hardest with 30 ± 14 N (weak)."
    )
    alone = replace(found, contacts=(wide,))
    assert headline(alone) == (
        "Something may have pushed the arm once. How hard is unknown: below 258 N."
    )
    assert "is seen only where the arm feels it best" in belief_words(
        replace(found, contacts=(sized(found.contacts[0], 1.0, 0.5),))
    )
    load = replace(found, contacts=(sized(found.contacts[0], 3.0, 5.0, is_load=True),))
    assert headline(load).startswith("The arm bears a load below 8 N, or its payload")
    assert "±14 N" in belief_words(both)
    untrue = replace(found, contacts=(), false_on_free=2)
    assert headline(untrue).startswith("No contact stands out from the free part")


def test_a_load_is_called_one(found: ContactList, pushed: Analysis) -> None:
    load = sized(
        found.contacts[0], 27.4, 2.2, is_load=True, mean_force=np.array([-0.2, 0.4, -27.4])
    )
    one = replace(found, contacts=(load,))
    assert headline(one).startswith("The arm bears a load of 27 ± 2 N, or its payload")
    assert "<b>(0, 0, −27) N</b>" in where_words(one.contacts)
    assert "would not be seen" not in lead(one)
    table = contact_table(pushed, one)
    assert "<h2>The load</h2>" in table
    assert ">weak<" not in table


def test_few_joints_tell_when_but_not_how_hard(found: ContactList, pushed: Analysis) -> None:
    two = replace(found, contacts=tuple(map(bare, found.contacts[:2])), smallest_force=None)
    assert headline(two) == "Something pushed the arm twice."
    assert belief_words(two) == "Contacts <b>1</b> and <b>2</b> are weak." or not belief_words(two)
    assert "unknown" in contact_row(pushed, two.contacts[0], 1.0)
    assert "–" in contact_details(two)


def test_the_places_are_told_together(found: ContactList) -> None:
    wrist, other = (replace(found.contacts[k], where=w) for k, w in ((0, "wrist"), (1, "forearm")))
    untold = replace(found.contacts[2], where="cannot tell")
    assert where_words([wrist]) == "It touched the <b>wrist</b>."
    assert where_words([wrist, replace(other, where="wrist")]) == "All touched the <b>wrist</b>."
    assert where_words([wrist, other, untold]) == (
        "Contact <b>1</b> touched the <b>wrist</b>; contact <b>2</b> touched the <b>forearm</b>; "
        "where contact <b>3</b> touched is unknown, since several places fit."
    )
    assert where_words(found.contacts).startswith("11 of 12 touched the <b>wrist</b>; where the ")
    assert listed([1, 3, 4]) == "<b>1</b>, <b>3</b> and <b>4</b>"
    assert where_words([]) == ""


def test_what_may_be_believed(found: ContactList) -> None:
    one = replace(found, contacts=found.contacts[:2], smallest_force=4.4)
    words = belief_words(one)
    assert "±0.1 s" in words
    assert "A touch below <b>4 N</b> would not be seen." in words
    assert belief_words(replace(one, smallest_force=float("nan"), contacts=())) == ""


def test_trust_says_why(found: ContactList) -> None:
    first = replace(found.contacts[0], evidence=400.0, anywhere=(45.0, 60.0), remarks=())
    assert reason(sized(first, 50.0, 5.0)) == "the band is 10% of the force"
    assert "the place" in reason(sized(first, 50.0, 5.0, anywhere=(20.0, 90.0)))
    assert "friction" in reason(replace(first, evidence=14.0))
    stop = caution("arm-stopped-abruptly", at_s=3.0)
    assert "stopped" in reason(replace(first, remarks=(stop,)))
    assert "few joints" in reason(bare(first))


def test_rows_are_the_anchors_of_the_list(found: ContactList, pushed: Analysis) -> None:
    table = contact_table(pushed, found)
    for k in range(1, 13):
        assert f'<tr id="contact-{k}">' in table
        assert f'href="#mark-{k}"' in table
    assert contact_table(pushed, replace(found, contacts=())) == ""


def test_the_details_hold_every_number(found: ContactList) -> None:
    html = contact_details(found)
    first = found.contacts[0]
    assert f"{first.joint_torque[1]:.2f} ± {first.joint_torque_sd[1]:.2f}".replace("-", "−") in html
    pairs = model_pairs(found)
    assert pairs["basis"] == "free motion"
    assert pairs["free motion"].endswith(" s")
    unknown = replace(found.model, noise_sd=np.full(6, np.nan), prior=None)
    assert "nan" not in str(model_pairs(replace(found, model=unknown)))
