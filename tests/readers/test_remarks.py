"""What the readers remark is data with words: every code has its sentence, and none is idle."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import vftcli.readers
from vftcli.readers.cleaning import cleaned
from vftcli.readers.reader import RawLog
from vftcli.readers.reading import read
from vftcli.signals.remarks import WORDS

MADE = re.compile(r"(?:fact|caution|warning)\(\s*\"([a-z-]+)\"")
CHOSEN = re.compile(r"\"([a-z]+(?:-[a-z]+)*)\" if .* else \"([a-z]+(?:-[a-z]+)*)\"")


def test_every_code_has_words_and_every_word_a_use():
    text = "".join(
        path.read_text(encoding="utf-8")
        for path in Path(vftcli.readers.__file__).parent.rglob("*.py")
    )
    chosen = {code for pair in CHOSEN.findall(text) for code in pair}
    words = set(tomllib.loads((WORDS / "readers.toml").read_text(encoding="utf-8")))
    assert set(MADE.findall(text)) <= words
    assert words <= set(MADE.findall(text)) | chosen


def log(stamps, **signals):
    """A raw log of two joints that stand still."""
    rest = np.zeros((len(stamps), 2))
    return RawLog(stamps=np.asarray(stamps), clock="test", signals={"q": rest, **signals})


@pytest.mark.parametrize(
    ("stamps", "rows"),
    [([0.0, 1.0, 1.0, 2.0], 1), ([0.0, 1.0, 1.0, 1.0], 2)],
)
def test_repeated_stamps_are_reported_with_their_number(stamps, rows):
    (remark,) = cleaned(log(stamps), Path("x"), "test").source.remarks
    assert str(remark) == f"dropped rows with the time stamp of the row before: {rows}"
    assert (remark.code, remark.level) == ("repeats-dropped", "fact")


def test_a_gap_is_reported_with_its_place_and_is_no_repair():
    source = cleaned(log([0.0, 1.0, 2.0, 3.0, 13.0, 14.0]), Path("x"), "test").source
    (remark,) = source.remarks
    assert (remark.code, remark.level) == ("clock-gaps", "caution")
    assert (remark.values["longest_s"], remark.values["at_s"]) == (10.0, 3.0)
    assert source.repairs == ()
    assert source.warnings == (str(remark),)


def test_a_cut_wrapping_is_reported(tmp_path):
    import gzip

    rows = "t,q_1,q_2\n" + "".join(f"{k / 100},0,{k / 100}\n" for k in range(100))
    (tmp_path / "log.csv.gz").write_bytes(gzip.compress(rows.encode())[:-8])
    remarks = {remark.code: remark for remark in read(tmp_path / "log.csv.gz").source.remarks}
    assert remarks["file-cut"].values["wrapping"] == "gzip"
