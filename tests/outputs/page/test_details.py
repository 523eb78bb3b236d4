from dataclasses import replace

import numpy as np
from contact_rows import contact, contact_list

from vftcli.analysis import Analysis
from vftcli.contacts.contact_list import OF_FORCES
from vftcli.outputs.page.log_charts import force_chart
from vftcli.outputs.page.pages import contact_details, model_pairs, render
from vftcli.outputs.page.shell import part


def test_a_load_is_called_one(pushed: Analysis) -> None:
    load = replace(
        pushed.contacts.contacts[0], peak_force=27.4, peak_band=2.2, place_band=2.2,
        is_load=True, mean_force=np.array([-0.2, 0.4, -27.4]),
    )  # fmt: skip
    table = render(replace(pushed, contacts=replace(pushed.contacts, contacts=(load,))))
    assert '<td class="trust ">load</td>' in table
    assert "△ weak" not in table


def test_few_joints_tell_when_but_not_how_hard(pushed: Analysis) -> None:
    unfelt = dict.fromkeys(OF_FORCES)
    rows = tuple(replace(row, **unfelt) for row in pushed.contacts.contacts)
    bare = replace(pushed.contacts, contacts=rows, smallest_force=None)
    page = render(replace(pushed, contacts=bare))
    listed = page.partition('id="believed"')[0]
    assert listed.count('<td class="force">unknown</td>') == 12
    assert 'id="force"' not in page
    assert 'id="contact-12"' in page
    assert force_chart(pushed, bare) is None
    assert "–" in part("parts/table", contact_details(bare)[0])


def test_the_details_hold_every_number(pushed: Analysis) -> None:
    found = pushed.contacts
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
