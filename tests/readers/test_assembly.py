"""Recordings of arrays, and estimates read again as a log."""

import numpy as np
import polars as pl
import pytest

from vftcli.readers.reading import assemble
from vftcli.readers.references import estimates_columns
from vftcli.signals.errors import LogError, MissingSignalError


def test_arrays_are_cleaned_like_a_log_that_is_read():
    t = [0.0, 0.1, 0.1, 0.2]
    made = assemble(t, name="mine", q=np.zeros((4, 6)), torque=np.ones((4, 6)))
    assert (made.name, made.samples, made.source.duplicates) == ("mine", 3, 1)
    assert made.signals == ("q", "torque")


@pytest.mark.parametrize("signals", [{"dq": np.zeros((2, 6))}, {"q": [[0.0], [0.0]], "tau": [1]}])
def test_positions_are_needed_and_names_are_those_of_a_recording(signals):
    with pytest.raises(MissingSignalError):
        assemble([0.0, 0.1], **signals)


def test_the_columns_of_an_observer_are_reported_of_our_own_files_alone(tmp_path):
    ours, other, text = (tmp_path / name for name in ("ours", "other", "text"))
    pl.DataFrame({"t": [0.0], "q/1": [0.0], "tau_ext/gmo/1": [1.0]}).write_parquet(ours)
    pl.DataFrame({"t": [0.0], "q/1": [0.0]}).write_parquet(other)
    text.write_text("t,q1\n0,0\n", encoding="utf-8")
    assert estimates_columns(ours, "gmo") == "t=t,q=q/{i},tau_ext=tau_ext/gmo/{i}"
    assert estimates_columns(other, "gmo") is None
    assert estimates_columns(text, "gmo") is None
    with pytest.raises(LogError, match="it holds gmo"):
        estimates_columns(ours, "fdo")
