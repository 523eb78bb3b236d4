"""Text tables: aliases, line ends, cut rows, garbage, clocks, and what is refused."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from seed_logs import table_csv, ur_csv

from vftcli.readers.reading import read, recognise
from vftcli.signals.errors import ClockError, LogError, UnknownFormatError
from vftcli.signals.recording import Recording

HEAD = "t,q1,q2"


def written(path: Path, text: str | bytes) -> Recording:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read(path)


def rows(count: int = 30, *, step: float = 0.01) -> list[str]:
    return [f"{step * k:.3f},{0.1 + 0.001 * k:.4f},{0.2 - 0.001 * k:.4f}" for k in range(count)]


def table(lines: list[str], end: str = "\n") -> str:
    return end.join([HEAD, *lines]) + end


PLAIN = table(rows())
DECIMAL_COMMAS = PLAIN.replace(",", ";").replace(".", ",")
DRESSES = {
    **{f"ends {end!r}": table(rows(), end) for end in (
        "\n", "\r\n", "\r\r\n", "\r", "\n\n", "\r\n\r\n", "\n \n")},
    **{f"separated {by!r}": PLAIN.replace(",", by) for by in (";", "\t", " ", "  ")},
    **{f"behind {first!r}": first + PLAIN for first in ("\ufeff", "# made by hand\n", "\n\n")},
    "quoted": PLAIN.replace(HEAD, '"t","q1","q2"'),
    "decimal commas": DECIMAL_COMMAS,
    # Behind tabs a name may hold a comma: the second line tells that it separates nothing.
    "tabs": DECIMAL_COMMAS.replace("q2", "wrist,deg").replace(";", "\t"),
}  # fmt: skip


@pytest.mark.parametrize("name", DRESSES)
def test_a_table_reads_the_same_however_it_is_dressed(path, name):
    recording = written(path, DRESSES[name])
    assert (recording.samples, recording.joints) == (30, 1 if name == "tabs" else 2)
    np.testing.assert_allclose(recording.t, 0.01 * np.arange(30), rtol=1e-12)
    np.testing.assert_allclose(recording.q[:, 0], 0.1 + 0.001 * np.arange(30), rtol=1e-12)


LATE = {
    "quoted numbers": lambda row: f'"{row}"'.replace(",", '","') + ",ok",
    "a quoted note with a comma": lambda row: f'{row},"pushed, twice"',
    "blanks about the numbers": lambda row: f" {row} ,ok".replace(",", " , "),
    "a note of 3 MB": lambda row: f"{row},{'x' * 3_000_000}",
    "a quoted note of 3 MB": lambda row: f'{row},"{"x" * 3_000_000}"',
    "a short row": lambda row: row,
}


@pytest.mark.parametrize("name", LATE)
def test_what_begins_after_the_first_lines_loses_no_row(path, name):
    lines = [f"{row},ok" for row in rows(400)]
    lines[300] = LATE[name](rows(400)[300])
    recording = written(path, "\n".join([f"{HEAD},note", *lines]) + "\n")
    np.testing.assert_allclose(recording.t, 0.01 * np.arange(400), rtol=1e-12)
    np.testing.assert_allclose(recording.q[:, 0], 0.1 + 0.001 * np.arange(400), rtol=1e-12)


def test_a_quote_that_is_not_closed_takes_no_rows(path):
    lines = [f"{row},ok" for row in rows(400)]
    lines[300], lines[310], lines[320] = (
        f"{rows(400)[k]},{note}" for k, note in ((300, '"far'), (310, '"near'), (320, '"a, b"'))
    )
    with pytest.raises(LogError, match="cannot be parsed"):
        written(path, "\n".join([f"{HEAD},note", *lines]) + "\n")


def test_short_rows_of_a_wide_table_are_not_filled_up(path):
    names = ",".join(f"x{k}" for k in range(6000))
    with pytest.raises(LogError, match="cannot be parsed"):
        written(path, "\n".join([f"{HEAD},{names}", *rows(4000)]) + "\n")


@pytest.mark.parametrize("cell", ["", " ", "   "])
def test_a_blank_cell_is_a_missing_number(path, cell):
    lines = rows(200)
    lines[150] = f"1.500,{cell},0.2"
    with pytest.raises(LogError, match="q of joint 1 is nan in sample 151"):
        written(path, table(lines))


def test_long_quoted_cells_at_the_end_are_read(path):
    note = '"' + "x" * 200_000 + '"'
    lines = [*rows(28), *(f"{row},{note}" for row in rows(30)[28:])]
    lines = [line if k > 27 else f"{line},ok" for k, line in enumerate(lines)]
    assert written(path, "\n".join([f"{HEAD},note", *lines]) + "\n").samples == 30


def test_rows_longer_than_the_names_are_counted_by_the_separator_of_the_names(path):
    for separator in (",", " "):
        text = table([f"{row},7" for row in rows()]).replace(",", separator)
        with pytest.raises(LogError, match="row 1 has 4 cells, the first line 3"):
            written(path, text)
    with pytest.raises(LogError, match="row 1 has 3 cells, the first line 2"):
        written(path, "t q1\n0 0.1 0.2\n1 0.1 0.2\n")


def test_savetxt_header_is_understood(path):
    matrix = np.column_stack([0.01 * np.arange(20), 0.1 * np.arange(20)])
    np.savetxt(path, matrix, header="t q1")
    np.testing.assert_allclose(read(path).q[:, 0], matrix[:, 1], rtol=1e-15)


def test_a_row_that_the_first_64_kib_cut_does_not_tell_the_separator(path):
    """Line 200 of as many is cut inside its second cell, so that it seems to have two."""
    lines = [f"{line}\n" for line in table(rows()).replace(",", ";").split()]
    room = 64 * 1024 - len(lines[0]) - len("0.000;0.1")
    comments = ["#" * 329 + "\n"] * 197
    comments.append("#" * (room - 197 * 330 - 1) + "\n")
    text = "".join([*comments, *lines])
    assert text[: 64 * 1024].endswith("t;q1;q2\n0.000;0.1")
    assert written(path, text).joints == 2


def test_columns_that_begin_with_whole_numbers_stay_numbers(path):
    lines = [f"{k / 100},0,0" for k in range(2000)]
    lines += [f"{20 + k / 100},-0.00068,1e-5" for k in range(10)]
    assert written(path, table(lines)).q[-1, 0] == -0.00068


INDEXED = ["q_0 q_1", "q[0] q[1]", "q.0 q.1", "q0 q1", "q1 q2", "qj1 qj2", "Q_joint1 Q_joint2",
           "actual_q_1 actual_q_2", "joint_pos_0 joint_pos_1", "state.q[0] state.q[1]",
           "q/1 q/2"]  # fmt: skip


@pytest.mark.parametrize("names", INDEXED)
def test_index_forms(path, names):
    recording = written(path, table(rows()).replace("q1,q2", names.replace(" ", ",")))
    assert recording.q[0].tolist() == [0.1, 0.2]


@pytest.mark.parametrize(
    ("names", "words"),
    [("t,q_1,actual_q_1", "could both be q"), ("t,time,q1", "could each be the clock")],
)
def test_two_candidates_are_refused(path, names, words):
    with pytest.raises(LogError, match=words):
        written(path, table(rows()).replace(HEAD, names))


@pytest.mark.parametrize(("name", "value"), [("tau_ext1", 2.5), ("tau_ext_hat_filtered_0", -2.5)])
def test_vendor_residual_is_turned_and_plain_tau_ext_is_not(path, name, value):
    text = table([f"{k / 100},0.1,2.5" for k in range(20)])
    recording = written(path, text.replace("q2", name))
    assert recording.require("tau_ext")[0, 0] == value
    turned = any("turned the sign of tau_ext_hat_filtered" in r for r in recording.source.repairs)
    assert turned == (value < 0)


@pytest.mark.parametrize(
    ("first", "step", "seconds"),
    [(0, 1, 1e-3), (1_700_000_000_000, 8, 8e-3), (0, 2, 2.0), (1_700_000_000_000_000, 8000, 8e-3),
     (1_700_000_000_000_000_001, 1_000_003, 1.000003e-3)],
)  # fmt: skip
def test_time_units_are_reported_by_size(path, first, step, seconds):
    lines = [f"{first + k * step},0.1,0.2" for k in range(20)]
    recording = written(path, table(lines))
    np.testing.assert_allclose(recording.t, seconds * np.arange(20), rtol=1e-12)
    if first > 1e18:  # nanoseconds keep every digit
        assert recording.source.t0_ns == first


@pytest.mark.parametrize("zone", ["", "Z", "+02:00"])
def test_dates_are_a_clock(path, zone):
    lines = [f"2024-05-01 12:00:{k / 100:09.6f}{zone},0.1,0.2" for k in range(20)]
    np.testing.assert_allclose(written(path, table(lines)).t, 0.01 * np.arange(20), rtol=1e-9)


CUT = ["0.300,0.13", "0.300,0.1", "0.3", "0.300,0.1300,", "0.300,0.1300,0.1"]


@pytest.mark.parametrize("last", CUT)
def test_a_cut_last_row_is_dropped_and_said(path, last):
    recording = written(path, table(rows()) + last)
    assert recording.samples == 30
    assert "dropped the last row: it is cut off" in recording.source.repairs


@pytest.mark.parametrize("count", [2, 20, 30])
def test_a_last_row_without_line_end_is_kept_if_its_digits_are_all_there(path, count):
    recording = written(path, table(rows(count)).rstrip("\n"))
    assert (recording.samples, recording.source.repairs) == (count, ())


def test_repeated_stamps_are_dropped_and_counted(path):
    lines = rows()
    for place in (10, 20, 20):
        lines.insert(place, lines[place])
    recording = written(path, table(lines))
    assert (recording.samples, recording.source.rows) == (30, 33)
    assert recording.source.duplicates == 3
    (remark,) = recording.source.remarks
    assert (remark.code, remark.level) == ("repeats-dropped", "fact")
    assert str(remark).endswith(": 3")
    lines.insert(10, lines[9].replace("0.1", "0.5", 1))
    assert "carry other values" in written(path, table(lines)).source.warnings[0]


def test_gaps_are_kept_and_reported_with_their_place(path):
    lines = rows(30) + [f"{5 + k / 100},0.1,0.2" for k in range(30)]
    recording = written(path, table(lines))
    assert recording.samples == 60
    (remark,) = recording.source.remarks
    assert (remark.code, remark.level, remark.values["gaps"]) == ("clock-gaps", "caution", 1)
    assert remark.values["longest_s"] == pytest.approx(4.71)
    assert remark.values["at_s"] == pytest.approx(0.29)
    assert (recording.source.repairs, recording.source.warnings) == ((), (str(remark),))


@pytest.mark.parametrize("garbage", ["1e154,0.1,0.2", "0,1e154,3", "nan,0.1,0.2", "0,nan,2",
                                     "3.1e-310,5e-320,1e9"])  # fmt: skip
def test_leading_garbage_is_dropped_and_said(path, garbage):
    lines = [garbage] * 8 + [f"{12621 + k / 100},0.1,0.2" for k in range(300)]
    recording = written(path, table(lines))
    assert (recording.samples, recording.source.t0) == (300, 12621)
    assert "garbage (absurd values or a jumping clock): 8" in recording.source.repairs[0]


BAD_CELLS = [
    ("0.150,,0.2", "nan in sample 151"),
    ("0.150,nan,0.2", "nan in sample 151"),
    ("0.150,inf,0.2", "inf in sample 151"),
    ("0.150,1e154,0.2", "1e\\+154 in sample 151"),
    ("0.150,oops,0.2", "row 151, column 2 .q1.: 'oops'"),
    ("0.150,0.1,0.2,0.3", "row 151 has 4 cells"),
    ("0.150,0.1", "nan in sample 151"),
    ("# event,1,2", "'# event' is not a number"),
]


@pytest.mark.parametrize(("row", "reported"), BAD_CELLS)
def test_a_bad_cell_in_the_middle_is_refused_with_its_place(path, row, reported):
    lines = rows(200, step=0.001)
    lines[150] = row
    with pytest.raises(LogError, match=reported):
        written(path, table(lines))


@pytest.mark.parametrize(
    ("content", "reported"),
    [
        (b"", "empty"),
        (HEAD.encode() + b"\n", "no samples"),
        (bytes(range(256)) * 40, "not recognised"),
        (b"just some words\nand more of them\n", "not recognised|no joint positions"),
        (b"\x1f\x8bnonsense", "gzip file is damaged"),
        (b"\x28\xb5\x2f\xfdnonsense", "zstd file is damaged"),
    ],
)
def test_what_is_no_log_is_refused(path, content, reported):
    with pytest.raises((LogError, ClockError), match=reported) as error:
        written(path, content)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "words"), [("missing", "no such file"), ("/dev/null", "neither a file nor a folder")]
)
def test_paths_that_are_no_files(tmp_path, name, words):
    with pytest.raises(LogError, match=words):
        read(tmp_path / name)


def test_the_content_decides_but_where_a_format_is_named(tmp_path):
    path = ur_csv(tmp_path / "log.parquet")
    assert recognise(path).name == "ur-csv"
    with pytest.raises(UnknownFormatError, match="known formats: ur-csv"):
        read(path, format="nonsense")
    columns = "t=timestamp,q=actual_q_{i}"
    assert read(path, format="table", columns=columns).target_q is None


@pytest.mark.parametrize("name", ["table", "headerless", "ur-csv", "bagpy", "ros2-echo"])
def test_what_is_no_text_is_refused_by_each_format_of_text(path, name):
    path.write_bytes(bytes(range(256)))
    with pytest.raises(LogError, match="not a table of text"):
        read(path, format=name)


def test_a_text_loads_no_reader_of_another_container(path):
    script = (
        "import sys; from vftcli.readers.reading import read; read(sys.argv[1]); "
        "heavy = 'h5py', 'mcap', 'pandas', 'polars', 'rosbags', 'scipy'; "
        "ours = (f'vftcli.readers.{name}' for name in "
        "('arrays', 'bags', 'hdf5', 'lerobot', 'objects', 'parquet')); "
        "sys.exit(str({*heavy, *ours} & set(sys.modules)))"
    )
    words = [sys.executable, "-c", script, str(table_csv(path))]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.stderr.strip() == "set()"
