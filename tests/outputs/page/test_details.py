import re
from dataclasses import replace

import numpy as np
import pytest
from contact_rows import contact, contact_list

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import Contact, ContactList
from vftcli.outputs.page.pages import contact_details, joint_values, model_pairs, render
from vftcli.outputs.page.shell import part


@pytest.fixture
def found(pushed: Analysis) -> ContactList:
    assert pushed.contacts is not None
    return pushed.contacts


def bare(contact: Contact) -> Contact:
    """The row of an arm whose joints tell no force."""
    return replace(contact, peak_force=None, peak_band=None, wrench=None, anywhere=None)


def sized(contact: Contact, force: float, band: float, **rest: object) -> Contact:
    return replace(contact, peak_force=force, peak_band=band, place_band=band, **rest)


def test_a_load_is_called_one(found: ContactList, pushed: Analysis) -> None:
    load = sized(
        found.contacts[0], 27.4, 2.2, is_load=True, mean_force=np.array([-0.2, 0.4, -27.4])
    )
    one = replace(found, contacts=(load,))
    table = render(replace(pushed, contacts=one))
    assert '<td class="trust ">load</td>' in table
    assert "△ weak" not in table


def test_few_joints_tell_when_but_not_how_hard(found: ContactList, pushed: Analysis) -> None:
    two = replace(found, contacts=tuple(map(bare, found.contacts[:2])), smallest_force=None)
    page = render(replace(pushed, contacts=two)).partition('id="believed"')[0]
    assert page.count('<td class="force">unknown</td>') == 2
    assert "–" in part("parts/table", contact_details(two)[0])


def test_rows_are_the_anchors_of_the_list(found: ContactList, pushed: Analysis) -> None:
    table = render(pushed)
    for k in range(1, 13):
        assert f'<tr id="contact-{k}"' in table
        assert f'href="#mark-{k}"' in table
    assert 'id="contacts"' not in render(replace(pushed, contacts=replace(found, contacts=())))


def test_the_details_hold_every_number(found: ContactList) -> None:
    shown = part("parts/table", contact_details(found)[1])
    first = found.contacts[0]
    torque, band = first.joint_torque[1], 1.96 * first.joint_torque_sd[1]
    assert f"{torque:.2f} ± {band:.2f}".replace("-", "−") in shown
    pairs = model_pairs(found)
    assert pairs["basis"] == "free motion"
    assert pairs["free motion"].endswith(" s")
    unknown = replace(found.model, noise_sd=np.full(6, np.nan), prior=None)
    assert "nan" not in str(model_pairs(replace(found, model=unknown)))


def test_the_wrench_of_a_row_is_force_moment_mean_and_impulse() -> None:
    """Each the numbers of `contact`, with their 95 % bands behind them."""
    wrench, torque = (grid.rows[0] for grid in contact_details(contact_list(contact())))
    assert wrench == (
        "1", "4.60 – 4.78", "57–78", "0.4, 51.9, −38.8", "3.7, 6.1, 5.5", "0.2, 0.1, 0.0",
        "1.0, 1.0, 1.0", "0.3, 32.0, −24.0", "0.1, 5.6, −4.1", 412.0, 44.0, None, None,
    )  # fmt: skip
    assert torque == ("1", *(f"{joint}.00 ± 1.96" for joint in range(6)), False)


def test_joints_that_agree_share_a_line() -> None:
    assert joint_values(np.array([10.0, 10.0])) == "10.0"
    text = joint_values(np.array([5.0, 10.0, 10.0, 7.0]))
    assert re.sub(r"<[^>]*>", " ", text).split() == ["J1", "5.00", "J2–J3", "10.0", "J4", "7.00"]
