"""Hostile files: a short run of the fuzzer, bombs, and claims beyond what a file holds."""

import gzip
import resource
import struct
from pathlib import Path

import pytest
from fuzz_readers import run
from seed_logs import bare_mcap, rosbag1

from vftcli.readers import read
from vftcli.signals.errors import LogError


def test_no_mutant_ends_in_anything_but_a_log_or_one_line() -> None:
    """A short run; the long one is documented in fuzz_readers.py."""
    verdicts, failures = run(540, seed=20250101)
    assert failures == []
    assert sum(n for name, n in verdicts.items() if name.endswith("read")) > 20


def peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


@pytest.mark.parametrize("wrap", ["gzip", "zstd"])
def test_decompression_bombs_are_bounded(tmp_path: Path, wrap: str) -> None:
    import zstandard

    before = peak_mib()
    bomb = b"t,q1\n" + b"0.1,0.2\n" * (64 << 20)  # half a gibibyte, shrinks a thousandfold
    pack = gzip.compress if wrap == "gzip" else zstandard.ZstdCompressor().compress
    (tmp_path / "x").write_bytes(pack(bomb))
    size = len(bomb) >> 20
    del bomb
    before = max(before, peak_mib())
    with pytest.raises(LogError, match="unpacks to more than 128 MiB"):
        read(tmp_path / "x")
    assert peak_mib() - before < 1024, size


def test_a_chunk_that_claims_too_much_is_refused(tmp_path: Path) -> None:
    path = rosbag1(tmp_path / "x", compression="LZ4")
    content = bytearray(path.read_bytes())
    place = content.index(b"size=") + 5
    content[place : place + 4] = struct.pack("<I", 2**32 - 1)
    path.write_bytes(content)
    with pytest.raises(LogError, match="claim to unpack to more than"):
        read(path)


def test_damaged_chunks_do_not_pass_their_checksum(tmp_path: Path) -> None:
    path = bare_mcap(tmp_path / "x")
    content = bytearray(path.read_bytes())
    content[3000] ^= 1
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"damaged|checksum"):
        read(path)


def test_nothing_is_written_beside_a_log(tmp_path: Path) -> None:
    path = rosbag1(tmp_path / "x")
    before = sorted(tmp_path.rglob("*"))
    read(path)
    assert sorted(tmp_path.rglob("*")) == before
    assert path.stat().st_nlink == 1
