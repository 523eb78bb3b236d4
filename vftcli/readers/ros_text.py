"""Tables that ROS tools print of JointState messages: bagpy, rostopic echo -p, ros2 topic echo."""

import ast
from dataclasses import dataclass
from functools import cached_property

from vftcli.readers.delimited import TextTable, as_number, split_cells
from vftcli.readers.formats import LogFormat
from vftcli.readers.joints import laid_along
from vftcli.readers.reader import LogFile, RawLog, ReadChoice
from vftcli.readers.tables import from_table
from vftcli.signals.errors import LogError

STAMP = 3  #: Columns before the names that ros2 topic echo --csv prints: sec, nanosec, frame_id.


@dataclass
class EchoTable(TextTable):
    """A table by ``ros2 topic echo --csv``: a message's fields in their order, without a header.

    Names, positions, velocities and efforts, as many of each or none, follow the header's stamp and
    frame.
    """

    @cached_property
    def joints(self) -> int:
        """Number of names in the first row; 0 where it is no such row."""
        cells = split_cells(self.sample[0], ",")
        numbers = [as_number(cell) for cell in cells]
        words = [k for k, number in enumerate(numbers) if number is None and k >= STAMP]
        count = len(words)
        values = len(cells) - STAMP - count
        stamped = len(cells) > STAMP and all(cell.isdigit() for cell in cells[:2])
        if not stamped or numbers[2] is not None or words != list(range(STAMP, STAMP + count)):
            return 0
        return count if count and values >= count and values % count == 0 else 0

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The columns' names, as rostopic would print them."""
        fields = ("name", "position", "velocity", "effort")
        count, width = self.joints, self.width
        named = [f"{fields[k // count]}{k % count}" for k in range(min(width - STAMP, 4 * count))]
        more = [f"_{k}" for k in range(width - STAMP - len(named))]
        return ("sec", "nanosec", "frame_id", *named, *more)

    @property
    def _header_is_comment(self) -> bool:
        """Always: no row of the file is a header."""
        return True


def joint_names(table: TextTable) -> tuple[str, ...]:
    """The joints' names that the rows hold, in the order of the columns."""
    names = table.names
    columns = [k for k, name in enumerate(names) if name.removeprefix("field.")[:4] == "name"]
    found = [table.words(column) for column in columns]
    for words in found:
        if len(words) > 1:
            raise LogError(
                f"{table.path}: the rows name different joints ({words[0][:60]} and "
                f"{words[1][:60]}), as where two controllers publish on one topic. Keep the rows "
                "of the arm."
            )
    if len(found) == 1 and found[0][0].startswith(("[", "(")):
        return listed_names(table, found[0][0])
    return tuple(words[0] for words in found)


def listed_names(table: TextTable, text: str) -> tuple[str, ...]:
    """The names of a list as Python prints it."""
    try:
        names = ast.literal_eval(text)
    except (ValueError, SyntaxError, RecursionError, MemoryError):
        names = None
    if not isinstance(names, list | tuple) or not all(isinstance(name, str) for name in names):
        raise LogError(f"{table.path}: the column name holds no list of joints: {text[:60]!r}")
    return tuple(names)


def read(file: LogFile, request: ReadChoice, layout: LogFormat) -> RawLog:
    """Read a printed JointState topic, its joints in the order of their names."""
    table = EchoTable(file) if layout.name == "ros2-echo" else TextTable(file)
    return laid_along(from_table(table, request), joint_names(table), request)


def recognises(file: LogFile, _: LogFormat) -> bool:
    """Whether a file was printed by ``ros2 topic echo --csv`` of a JointState topic."""
    cells = split_cells(file.first_line.decode("utf-8", "replace"), ",")
    return len(cells) > STAMP and EchoTable(file).joints > 0
