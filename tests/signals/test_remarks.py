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
    values = {"share": 0.5, "limits_Nm": [1.25, 2.0]}
    remark = Remark("joint-rests", "caution", values, Where("gmo", (1, 3), (0.5, 2.0)))
    assert sentence(remark) == "gmo: J1, J3 rests in 50% of the samples"
    assert sentence(remark, "long") == "gmo: J1, J3 rests from 0.5 to 2 s: 1.2 2.0 N·m"
    # Long words fall back to the short ones, lists are separated by commas.
    left = Remark("left-out", values={"topics": ["/a", "/b"]})
    assert sentence(left, "long") == str(left) == "left out /a, /b"
    # A band is 1.96 deviations, and a minus is a minus.
    assert str(Remark("load", values={"load_kg": -1.5, "sd_kg": 0.1})) == "−1.50 ± 0.20 kg"
    record = as_record(Remark("left-out", "warning", {"topics": ["/a"]}, Where(joints=(2,))))
    expected = {"code": "left-out", "level": "warning", "values": {"topics": ["/a"]}}
    assert record.items() >= (expected | {"joints": [2]}).items()


def test_an_unknown_code_is_an_error() -> None:
    with pytest.raises(LookupError, match="no-such-remark"):
        words("no-such-remark")


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
    assert set(entry) <= {"short", "long", "name", "consequence", "remedy"}
    for key, template in entry.items():
        assert list(string.Formatter().parse(template))  # it can be parsed
        riddle = RIDDLES.search(template)
        assert riddle is None, f"{code}.{key} says {riddle and riddle.group()!r}: say it plainly"
    parts = string.Formatter().parse(entry["short"])
    length = sum(len(words) + VALUE_LENGTH * (value is not None) for words, value, *_ in parts)
    assert length <= 100, f"{code} has {length} characters: put detail into `long`"
