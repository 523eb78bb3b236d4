"""Freed memory goes back through the C library; another library does no harm."""

import ctypes

import pytest

from vftcli.cli.analysis import LARGE, give_back


def test_the_c_library_knows_it_once_it_can(monkeypatch: pytest.MonkeyPatch) -> None:
    reported: list[tuple[int, int]] = []

    class Library:
        def mallopt(self, what: int, size: int) -> None:
            reported.append((what, size))

    monkeypatch.setenv("ARROW_DEFAULT_MEMORY_POOL", "mimalloc")
    monkeypatch.setattr(ctypes, "CDLL", lambda _: Library())
    give_back()
    assert reported == [(-3, LARGE)]  # M_MMAP_THRESHOLD of malloc.h
    monkeypatch.setattr(ctypes, "CDLL", lambda _: object())  # one without mallopt
    give_back()
