"""Opening: wrappings taken off within bounds, digests of files and folders."""

import gzip
import hashlib

import pytest
import zstandard

from vftcli.readers import opening
from vftcli.readers.opening import HEAD_BYTES, open_log, sha256_of
from vftcli.readers.reading import FORMATS, read
from vftcli.signals.errors import LogError

CONTENT = bytes(range(256)) * 1000


def test_the_head_is_that_of_the_content_whatever_it_is_wrapped_in(tmp_path):
    packers = {None: bytes, "gzip": gzip.compress, "zstd": zstandard.compress}
    for wrapping, pack in packers.items():
        path = tmp_path / f"x.{wrapping}"
        path.write_bytes(pack(CONTENT))
        file = open_log(path)
        assert (file.head, file.wrapping) == (CONTENT[:HEAD_BYTES], wrapping)
        assert (bytes(file.content), file.remarks) == (CONTENT, ())


@pytest.mark.parametrize("wrapping", ["gzip", "zstd"])
def test_wrapped_pieces_one_behind_the_other_are_one_content(tmp_path, wrapping):
    pack = gzip.compress if wrapping == "gzip" else zstandard.compress
    (tmp_path / "x").write_bytes(pack(CONTENT) + pack(b"more"))
    assert bytes(open_log(tmp_path / "x").content) == CONTENT + b"more"


def test_a_cut_wrapping_yields_what_there_is_and_says_so(tmp_path):
    packed = gzip.compress(hashlib.shake_256(b"noise").digest(100_000))
    (tmp_path / "x").write_bytes(packed[: len(packed) // 2])
    file = open_log(tmp_path / "x")
    assert [remark.code for remark in file.remarks] == ["file-cut"]
    assert 40_000 < len(file.content) < 60_000


def test_a_file_that_unpacks_beyond_its_limit_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(opening, "UNPACKED_LIMIT", 1000)
    monkeypatch.setattr(opening, "UNPACKED_RATIO", 2)
    (tmp_path / "x").write_bytes(gzip.compress(bytes(100_000)))
    with pytest.raises(LogError, match="unpacks to more than"):
        _ = open_log(tmp_path / "x").content


@pytest.mark.parametrize(("content", "said"), [(b"", "is empty"), (None, "no such file")])
def test_what_cannot_be_opened_is_said(tmp_path, content, said):
    if content is not None:
        (tmp_path / "x").write_bytes(content)
    with pytest.raises(LogError, match=said):
        open_log(tmp_path / "x")


def test_the_digest_of_a_folder_is_that_of_its_files_in_name_order(tmp_path):
    (tmp_path / "bag" / "sub").mkdir(parents=True)
    for name, content in {"b": b"2", "a": b"1", "sub/c": b"3"}.items():
        (tmp_path / "bag" / name).write_bytes(content)
    assert sha256_of(tmp_path / "bag") == hashlib.sha256(b"123").hexdigest()
    assert sha256_of(tmp_path / "bag" / "a") == hashlib.sha256(b"1").hexdigest()


@pytest.mark.parametrize("name", [n for n, layout in FORMATS.items() if not layout.folder])
def test_a_folder_read_as_a_format_of_files_is_refused_in_one_line(tmp_path, name):
    (tmp_path / "log.csv").write_text("t,q_1\n0,1\n1,2\n", encoding="utf-8")
    with pytest.raises(LogError, match=f"^{tmp_path}: [^\n]+$") as refusal:
        read(tmp_path, format=name)
    if name in {"parquet", "npz", "json", "mat"}:
        assert "a folder, and the chosen format is of files" in str(refusal.value)
