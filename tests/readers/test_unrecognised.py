"""For a path that no reader knows the error says what it is and what to do."""

import shlex
from pathlib import Path

import pytest

from vftcli.readers.reading import read
from vftcli.signals.errors import UnknownFormatError


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
        ("t,q1\n0,1\n".encode("utf-16"), "UTF-16"),
        (
            b"# A title\nSome words.\n\nAnd more of them.\n",
            "a text that is no table of numbers .*'# A title'",
        ),
        (bytes(range(200)), "a binary file of no kind that is known .*00 01 02 03"),
    ],
)
def test_a_file_that_is_no_log_is_named(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "file"
    path.write_bytes(content)
    with pytest.raises(UnknownFormatError, match=f"not recognised as a log: .*{words}"):
        read(path)


def test_a_folder_of_logs_says_how_to_run_all(tmp_path: Path) -> None:
    with pytest.raises(UnknownFormatError, match="an empty folder"):
        read(tmp_path)
    for name in ("a.csv", "b.csv", "c.npy", "readme.md"):
        (tmp_path / name).write_text("t,q1\n", "utf-8")
    with pytest.raises(
        UnknownFormatError, match=r"a folder of files that may be logs .*/\*\.csv -o OUT\)"
    ) as e:
        read(tmp_path)
    assert "\n" not in str(e.value)
    assert f"for f in {shlex.quote(str(tmp_path))}/*.csv; do vftcli" in str(e.value)
    for path in tmp_path.iterdir():
        path.rename(path.with_suffix(".md"))
    with pytest.raises(UnknownFormatError, match="a folder without a log"):
        read(tmp_path)


def test_a_table_is_not_taken_for_a_document(tmp_path: Path) -> None:
    """Columns called as other files begin: MZ of a moment."""
    rows = "".join(f"{k / 100},.{k},.{k},.{k}\n" for k in range(30))
    for first in ("MZ", "BM", "%!PS"):
        path = tmp_path / "log.csv"
        path.write_text(f"{first},q_1,q_2,q_3\n{rows}", "utf-8")
        assert read(path, columns=f"t={first},q=q_{{i}}").joints == 3
