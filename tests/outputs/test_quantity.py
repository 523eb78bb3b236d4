"""Numbers with their units, as every output writes them."""

from vftcli.outputs.grid import at_least_shown, banded, percent, signed, significant, vector
from vftcli.signals.parsing import counted


def test_numbers_have_their_digits_bands_and_a_true_minus() -> None:
    shown = {
        0.42649: "0.426", 12.346: "12.3", 1234.5: "1234", 0.0027812: "0.00278", 0.9996: "1.00",
        9.996: "10.0", 0.0: "0", -1.234: "-1.23", 1.5e-7: "1.50e-07", float("nan"): "–",
        float("inf"): "–",
    }  # fmt: skip
    assert {value: significant(value) for value in shown} == shown
    assert [signed(value) for value in shown] == [t.replace("-", "−") for t in shown.values()]
    shown = {0.00099: "0.1 %", 0.0004: "0.04 %", 0.123: "12.3 %", 2e-7: "<0.001 %", 0.0: "0 %"}
    assert {share: percent(share) for share in shown} == shown
    assert banded(65.2, 7.4) == "65 ± 7 N"
    assert banded(-36.894, 2.15, ".2f", "") == "−36.89 ± 2.15"
    assert vector([-0.04, 2.0, -3.14]) == "0.0, 2.0, −3.1"
    assert [counted(k, "contact") for k in (0, 1, 2)] == ["0 contacts", "1 contact", "2 contacts"]
    assert [at_least_shown(force) for force in (0.31, 0.97, 4.4)] == ["0.3 N", "1 N", "4 N"]
