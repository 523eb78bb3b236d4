"""Remarks: data in the code, words in the catalogue."""

import re
import string

import pytest

from vftcli.signals import remarks
from vftcli.signals.remarks import Remark, Where, as_record, sentence, words


@pytest.fixture
def catalogue(monkeypatch: pytest.MonkeyPatch) -> None:
    text = (
        "[joint-rests]\n"
        'short = "{joints} rests in {share:.0%} of the samples"\n'
        'long = "{joints} rests from {span[0]:g} to {span[1]:g} s: {limits_Nm:.1f} N·m"\n'
        '[left-out]\nshort = "left out {topics}"\n'
        '[load]\nshort = "{load_kg:.2f} {sd_kg:±.2f} kg"\n'
    )
    monkeypatch.setattr(remarks, "catalogue", lambda: (text,))


@pytest.mark.usefixtures("catalogue")
def test_words_are_made_of_values_and_place() -> None:
    remark = Remark(
        "joint-rests",
        "caution",
        {"share": 0.5, "limits_Nm": [1.25, 2.0]},
        Where("gmo", (1, 3), (0.5, 2.0)),
    )
    assert sentence(remark) == "gmo: J1, J3 rests in 50% of the samples"
    assert sentence(remark, "long") == "gmo: J1, J3 rests from 0.5 to 2 s: 1.2 2.0 N·m"


@pytest.mark.usefixtures("catalogue")
def test_long_words_fall_back_to_the_short_ones_and_lists_are_separated_by_commas() -> None:
    remark = Remark("left-out", values={"topics": ["/a", "/b"]})
    assert sentence(remark, "long") == str(remark) == "left out /a, /b"


@pytest.mark.usefixtures("catalogue")
def test_a_band_is_1_96_deviations_and_a_minus_is_a_minus() -> None:
    load = Remark("load", values={"load_kg": -1.5, "sd_kg": 0.1})
    assert str(load) == "−1.50 ± 0.20 kg"


@pytest.mark.usefixtures("catalogue")
def test_a_record_holds_code_and_values() -> None:
    record = as_record(Remark("left-out", "warning", {"topics": ["/a"]}, Where(joints=(2,))))
    assert record["code"] == "left-out"
    assert record["level"] == "warning"
    assert record["values"] == {"topics": ["/a"]}
    assert record["joints"] == [2]


def test_an_unknown_code_is_an_error() -> None:
    with pytest.raises(LookupError, match="no-such-remark"):
        words("no-such-remark")


def test_every_code_stands_once_and_its_templates_can_be_parsed() -> None:
    codes = [code for text in remarks.catalogue() for code in remarks.parsed(text)]
    assert len(codes) == len(set(codes))
    for text in remarks.catalogue():
        for entry in remarks.parsed(text).values():
            assert set(entry) <= {"short", "long", "name", "consequence", "remedy"}
            for template in entry.values():
                assert list(string.Formatter().parse(template))


#: A template's length as a reader meets it: a value counts as five characters.
VALUE_LENGTH = 5
RIDDLES = re.compile(
    r"\b(told|untold|taken|laid over|whose|caught|stands|likewise|the same)\b", re.IGNORECASE
)


@pytest.mark.parametrize(
    ("code", "entry"),
    [item for text in remarks.catalogue() for item in remarks.parsed(text).items()],
)
def test_words_are_short_and_plain(code: str, entry: dict[str, str]) -> None:
    for key, template in entry.items():
        riddle = RIDDLES.search(template)
        assert riddle is None, f"{code}.{key} says {riddle and riddle.group()!r}: say it plainly"
    parts = string.Formatter().parse(entry["short"])
    length = sum(len(words) + VALUE_LENGTH * (value is not None) for words, value, *_ in parts)
    assert length <= 100, f"{code} has {length} characters: put detail into `long`"
