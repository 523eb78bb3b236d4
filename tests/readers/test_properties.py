"""Properties that hold for any numbers: a written table reads back as it was written."""

import unicodedata

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from seed_logs import rows_of

from vftcli.readers.columns import parse_columns
from vftcli.readers.reading import read
from vftcli.signals.errors import VftError
from vftcli.signals.parsing import HIDDEN, printable

TABLES = st.tuples(st.integers(2, 40), st.integers(1, 7)).flatmap(
    lambda shape: arrays(
        np.float64, (shape[0], 2 * shape[1]), elements=st.floats(-6, 6, allow_subnormal=False)
    )
)
QUICK = settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def check_message(error: VftError) -> None:
    # A blank that does not break is a letter like another, though Python calls it unprintable.
    assert not any(unicodedata.category(letter) in HIDDEN for letter in printable(str(error)))
    assert len(str(error)) > 20


@QUICK
@given(
    values=TABLES,
    step=st.floats(1e-3, 0.5),
    start=st.floats(0, 1e6),
    separator=st.sampled_from([",", ";", "\t", " "]),
    end=st.sampled_from(["\n", "\r\n", "\r\r\n", "\r"]),
    headed=st.booleans(),
    closed=st.booleans(),
)
def test_a_text_table_reads_back(path, values, step, start, separator, end, headed, closed):
    """All rows and all digits, whatever separates them; an open last row may be dropped, said."""
    rows, joints = len(values), values.shape[1] // 2
    t = start + step * np.arange(rows)
    lines = rows_of(t, values, separator=separator)
    if headed:
        names = ["t", *(f"{name}_{j}" for name in ("q", "dq") for j in range(joints))]
        lines.insert(0, separator.join(names))
    path.write_bytes((end.join(lines) + (end if closed else "")).encode())
    recording = read(path, columns=None if headed else f"t[s],q[rad]:{joints},dq:{joints}")
    kept = recording.samples
    assert kept == rows or (not closed and kept == rows - 1 and recording.source.repairs)
    np.testing.assert_array_equal(recording.q, values[:kept, :joints])
    np.testing.assert_array_equal(recording.dq, values[:kept, joints:])


@QUICK
@given(text=st.text(alphabet="tqdcurentaw_:=-[]{}i@,|0123456789Hz ", max_size=40))
def test_any_columns_text_is_parsed_or_refused_on_one_line(text):
    try:
        spec = parse_columns(text)
    except VftError as error:
        check_message(error)
    else:
        assert spec.items or spec.segment is not None


@QUICK
@given(content=st.binary(min_size=1, max_size=600))
def test_any_bytes_are_read_or_refused_on_one_line(path, content):
    path.write_bytes(content)
    try:
        recording = read(path)
    except VftError as error:
        check_message(error)
    else:
        assert recording.samples > 0
