"""Opening: wrappings taken off within bounds, digests, and by what words a path is no log."""

import gzip
import hashlib
import shlex
from collections.abc import Callable

import numpy as np
import pytest
import zstandard
from seed_logs import ROWS, motion, table_csv

from vftcli.readers.opening import HEAD_BYTES, open_log, sha256_of
from vftcli.readers.reading import FORMATS, read
from vftcli.signals.errors import LogError, UnknownFormatError

CONTENT = bytes(range(256)) * 1000
PACK: dict[str | None, Callable[[bytes], bytes]] = {
    None: bytes, "gzip": gzip.compress, "zstd": zstandard.compress,
}  # fmt: skip


@pytest.mark.parametrize("wrapping", PACK)
def test_the_content_is_the_same_whatever_it_is_wrapped_in(path, wrapping):
    pack = PACK[wrapping]
    path.write_bytes(pack(CONTENT))
    file = open_log(path)
    assert (file.head, file.wrapping) == (CONTENT[:HEAD_BYTES], wrapping)
    assert (bytes(file.content), file.remarks) == (CONTENT, ())
    path.write_bytes(pack(CONTENT) + pack(b"more"))  # two pieces
    assert bytes(open_log(path).content) == CONTENT + b"more"
    path.write_bytes(pack(table_csv(path).read_bytes()))
    np.testing.assert_array_equal(read(path).q, motion()["q"])


def test_a_cut_wrapping_yields_what_there_is_and_says_so(path):
    packed = gzip.compress(hashlib.shake_256(b"noise").digest(100_000))
    path.write_bytes(packed[: len(packed) // 2])
    file = open_log(path)
    (remark,) = file.remarks
    assert (remark.code, remark.values["wrapping"]) == ("file-cut", "gzip")
    assert 40_000 < len(file.content) < 60_000
    table = table_csv(path).read_bytes()
    packed = gzip.compress(table)
    path.write_bytes(packed[: len(packed) // 2])
    short = read(path)
    assert 0 < short.samples < ROWS
    assert any("file is cut" in reported for reported in short.source.warnings)
    path.write_bytes(zstandard.compress(table)[:5000])
    with pytest.raises(LogError, match="unpacks to nothing"):  # a single block is lost whole
        read(path)


def test_the_digest_of_a_folder_is_that_of_its_files_in_name_order(tmp_path):
    (tmp_path / "bag" / "sub").mkdir(parents=True)
    for name, content in {"b": b"2", "a": b"1", "sub/c": b"3"}.items():
        (tmp_path / "bag" / name).write_bytes(content)
    assert sha256_of(tmp_path / "bag") == hashlib.sha256(b"123").hexdigest()
    path = table_csv(tmp_path / "x")
    assert read(path).source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    path.write_text(path.read_text("utf-8").replace("\n", "\n\n", 1), "utf-8")
    assert read(path).source.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("name", [n for n, layout in FORMATS.items() if not layout.folder])
def test_a_folder_read_as_a_format_of_files_is_refused_in_one_line(tmp_path, name):
    (tmp_path / "log.csv").write_text("t,q_1\n0,1\n1,2\n", encoding="utf-8")
    with pytest.raises(LogError, match=f"^{tmp_path}: [^\n]+$") as refusal:
        read(tmp_path, format=name)
    if name in {"parquet", "npz", "json", "mat"}:
        assert "a folder, and the chosen format is of files" in str(refusal.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\x89PNG\r\n\x1a\n" + bytes(50), "a picture"),
        (b"\0\0\0\x18ftypmp42" + bytes(50), "a video"),
        (b"%PDF-1.7\n%\xe2\xe3", "a PDF"),
        (b'<?xml version="1.0"?>\n<!-- a -->\n<robot name="arm">\n</robot>\n', "--robot"),
        (b"<!DOCTYPE html>\n<html>\n", "XML"),
        (b"PK\x03\x04" + bytes(50), "a zip archive; unpack it"),
        (b'schema = 1\nname = "arm"\n', "a TOML file; a robot file goes to --robot"),
        (b'robot = "ur5"\nfree = ["free.csv"]\n', "a TOML file; .* options to --config"),
        (b"<svg xmlns='http://www.w3.org/2000/svg'></svg>", "a page or document in XML"),
        (b"header: \n  seq: 0\n  stamp: \n", "a text in YAML; .* -p and --csv"),
        (b"\\documentclass{article}\n\\begin{document}\n", "a LaTeX text"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\n", "git lfs pull"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(50), "save the sheet as CSV"),
        (b"PK\x03\x04" + bytes(50) + b"xl/workbook.xml", "an Excel workbook; save the sheet"),
        (b"PK\x03\x04" + bytes(50) + b"word/document.xml", "a Word document"),
        (b"RIFF\x24\0\0\0WAVEfmt ", "a sound"),
        (b"ULog\x01\x12\x35\x01" + bytes(99), "a PX4 ULog"),
        ("t,q1\n0,1\n".encode("utf-16"), "UTF-16"),
        (b"# A title\nSome.\n\nAnd more.\n", "that is no table of numbers .*'# A title'"),
        (bytes(range(200)), "a binary file of no kind that is known .*00 01 02 03"),
    ],
)
def test_a_file_that_is_no_log_is_named(path, content, words):
    path.write_bytes(content)
    with pytest.raises(UnknownFormatError, match=f"not recognised as a log: .*{words}"):
        read(path)


def test_a_folder_of_logs_says_how_to_run_all(tmp_path):
    with pytest.raises(UnknownFormatError, match=r"a folder \(empty\)"):
        read(tmp_path)
    (tmp_path / "a.csv").write_text("t,q1\n", "utf-8")
    words = r"a folder \(a.csv\); batch runs all logs in it"
    with pytest.raises(UnknownFormatError, match=words) as e:
        read(tmp_path)
    assert f"vftcli batch {shlex.quote(str(tmp_path))} --do report -o OUT" in str(e.value)
    assert "\n" not in str(e.value)


@pytest.mark.parametrize("first", ["MZ", "BM", "%!PS"])
def test_a_table_is_not_taken_for_a_document(path, first):
    """Columns called as other files begin: MZ of a moment."""
    rows = "".join(f"{k / 100},.{k},.{k},.{k}\n" for k in range(30))
    path.write_text(f"{first},q_1,q_2,q_3\n{rows}", "utf-8")
    assert read(path, columns=f"t={first},q=q_{{i}}").joints == 3
