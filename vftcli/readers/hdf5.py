"""HDF5 logs, read within bounds by h5py: ALOHA's, DROID's, or any by its paths."""

import itertools
import math
import os
import re
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

from vftcli.readers.aliases import ALIASES, TABLE
from vftcli.readers.columns import parse_columns
from vftcli.readers.opening import (
    LogFile,
    check_unpacked,
    naming_damage,
    natural,
    open_log,
    unpacked_limit,
)
from vftcli.readers.reader import ARMS, Episodes, RawLog, ReadChoice, arm_of
from vftcli.readers.reading import FORMATS, LogFormat
from vftcli.readers.table import Blocks, Places, listed
from vftcli.readers.tables import ArrayTable, from_table
from vftcli.signals.errors import LogError
from vftcli.signals.packages import needed
from vftcli.signals.remarks import fact

Hdf5 = Any  #: A file, group, dataset or chunk of h5py, which has no stubs.

#: Filters by HDF5's numbers; those of h5py, MATLAB and the common recorders.
DEFLATE, SHUFFLE, FLETCHER32, LZF = 1, 2, 3, 32000
DEFLATE_RATIO = 1032  #: The most that deflate unpacks a byte to (zlib, algorithm.txt).


def _check_chunks(name: str, dataset: Hdf5, limit: int) -> None:
    if dataset.chunks is None:
        return
    size = math.prod(dataset.chunks) * dataset.dtype.itemsize
    if size > limit:
        raise LogError(f"{name}: its chunks unpack to {size >> 20} MiB each, more than its rows.")
    settings = dataset.id.get_create_plist()
    filters = [settings.get_filter(k)[0] for k in range(settings.get_nfilters())]
    # Two filters of one kind may unpack a million times the size.
    if set(filters) - {DEFLATE, SHUFFLE, FLETCHER32, LZF} or len(set(filters)) < len(filters):
        raise LogError(
            f"{name}: packed by HDF5's filters {filters}, of which deflate, shuffle, fletcher32 "
            "and lzf are read, once each; repack it: h5repack -f GZIP=4 OLD NEW"
        )
    if DEFLATE not in filters or DEFLATE_RATIO * dataset.id.get_storage_size() <= limit:
        return
    chunks: list[Hdf5] = []
    dataset.id.chunk_iter(chunks.append)
    for chunk in (chunk for chunk in chunks if DEFLATE_RATIO * chunk.size > limit):
        _, packed = dataset.id.read_direct_chunk(chunk.chunk_offset)
        # No more than this was unpacked; HDF5 says where it breaks off.
        with suppress(zlib.error):
            if len(zlib.decompressobj().decompress(packed, size + 1)) > size:
                raise LogError(
                    f"{name}: a chunk unpacks to more than the {size} bytes that it holds."
                )


#: Most objects, and depth of groups; a log has some hundred.
MOST_OBJECTS, DEEPEST = 100_000, 32


@contextmanager
def opened(file: LogFile) -> Iterator[Any]:
    """The file as h5py opens it; its errors name the file."""
    h5py = needed("h5py", f"{file.path}: an HDF5 file", error=LogError)
    with (
        naming_damage(file.path, "a damaged HDF5 file"),
        h5py.File(file.direct or BytesIO(file.content), "r") as content,
    ):
        yield content


class Hdf5Table(ArrayTable):
    """The datasets of numbers in an open HDF5 file or a group, as columns.

    Images, texts, links and what claims more than it stores are left out; none is read yet.
    """

    def within(self, group: str, *, top: bool = False) -> "Hdf5Table":
        """The datasets below a group, by paths from there, or of no group."""
        own = {
            name.removeprefix(group): dataset
            for name, dataset in self.columns.items()
            if name.startswith(group) or (top and "/" not in name)
        }
        return Hdf5Table(self.path, own)

    def blocks(self, columns: Places, clock: int | None) -> Blocks:
        """Read datasets as float64; whole stamps stay whole."""
        self.check_size(columns)
        return super().blocks(columns, clock)

    def check_size(self, columns: Places) -> None:
        """Check that datasets may be read: a file of a kilobyte may claim any size."""
        each = [list(self.columns.items())[c] for c in columns]
        stored = sum(dataset.id.get_storage_size() for _, dataset in each)
        what = f"{self.path}: {listed([name for name, _ in each])}"
        check_unpacked(what, 8 * sum(dataset.size for _, dataset in each), stored)
        for name, dataset in each:
            _check_chunks(f"{self.path}: {name}", dataset, unpacked_limit(stored))


def table_of(path: Path, content: Hdf5, fewest_rows: int = 2) -> Hdf5Table:
    """The datasets of numbers with some rows in an open file."""
    import h5py

    found, looked_at = {}, itertools.count(1)

    def look(name: str, item: Hdf5) -> None:
        if next(looked_at) > MOST_OBJECTS or name.count("/") > DEEPEST:
            raise LogError(
                f"{path}: more than {MOST_OBJECTS} objects or {DEEPEST} levels; no log has."
            )
        if not isinstance(item, h5py.Dataset) or item.dtype.kind not in "fiub":
            return
        shape = item.shape or (0,)
        own = not item.is_virtual and not item.external
        if own and len(shape) <= 2 and all(shape) and shape[0] >= fewest_rows:
            found[name] = item

    content.visititems(look)  # comes to each once, and not elsewhere
    if not found:
        raise LogError(f"{path}: an HDF5 file without datasets of numbers, so no log.")
    return Hdf5Table(path, dict(sorted(found.items(), key=lambda item: natural(item[0]))))


ALOHA_RATE = 50.0  #: ALOHA's recorder steps by 0.02 s and stores no clock. [Hz]
ALOHA_WIDTH, ALOHA_ARM = 14, 7  #: Two arms of six joints, a gripper behind each.
#: ALOHA's positions and efforts.
ALOHA, DYNAMIXEL = "observations/qpos", "observations/effort"

DROID_STATE = "observation/robot_state/"
#: What DROID's controller commands, without gravity; what it measures includes it.
DROID_COMPUTED = f"{DROID_STATE}joint_torques_computed"
#: Where projects that record no torque keep their positions → the project.
TORQUELESS = {"obs/robot0_joint_pos": "robomimic", "qp_arm": "roboset"}
#: An episode's metadata: the serial number begins with a profile's name.
SERIAL = re.compile(rb'"robot_serial": *"(panda|fr3)-')
DESCRIPTION_BYTES = 1 << 20  #: Bytes of a description that are looked at.

TRAJECTORY = "trajectory.h5"
MOST_LOOKED_AT = 2000  #: Folders that are looked at to recognise a release.


def read_aloha(table: Hdf5Table, request: ReadChoice) -> RawLog:
    """ALOHA: two arms of six joints and a gripper each, no clock, efforts in mA."""
    names = table.names
    if request.spec.item("q") or table.lists.get(names.index(ALOHA), 1) != ALOHA_WIDTH:
        return read_any(table, request)
    places = "left: columns 0-5, right: columns 7-12"
    arm, remarks = arm_of(table.path, request, ARMS, places)
    first = ALOHA_ARM * ARMS.index(arm)
    span = f"[{first}:{first + ALOHA_ARM - 1}]"
    usual = (
        f"t@{ALOHA_RATE:g}Hz,q[rad]={ALOHA}{span},dq=observations/qvel{span},"
        f"current[mA]={DYNAMIXEL}{span}"
    )
    if DYNAMIXEL in names:
        remarks = (*remarks, fact("effort-of-dynamixel"))
    clock = f"none: {ALOHA_RATE:g} Hz, ALOHA's convention"
    layout = TABLE._replace(columns=usual, clock=clock)
    return replace(from_table(table, request, layout, remarks=remarks), part=f"{arm} arm")


def read_droid(table: Hdf5Table, request: ReadChoice) -> RawLog:
    """DROID: the robot state's clock; motor_torques_measured is libfranka's tau_J."""
    if request.spec.item("q"):
        return from_table(table, request)
    remarks = (fact("computed-torque-left-out"),) if DROID_COMPUTED in table.names else ()
    raw = from_table(table, request, FORMATS["droid"], remarks=remarks)
    for path in sorted(Path(table.path).parent.glob("metadata_*.json"))[:1]:
        with suppress(OSError), path.open("rb") as file:
            if match := SERIAL.search(file.read(DESCRIPTION_BYTES)):
                raw = replace(raw, robot_hint=match[1].decode())
    return raw


def read_any(table: Hdf5Table, request: ReadChoice) -> RawLog:
    """Any other file: by --columns, or by alias among the datasets of one group."""
    if request.spec.item("q"):
        return from_table(table, request)
    names = table.names
    for path, project in TORQUELESS.items():
        if any(f"/{name}".endswith(f"/{path}") for name in names):
            raise LogError(
                f"{table.path}: has the layout of {project}, which has no torque. If you added "
                "torques, name all: --columns t@20Hz,q=PATH/OF/POSITIONS,tau=PATH/OF/TORQUES."
            )
    # The datasets of the one group with positions, and those at the top.
    return from_table(table.within(level_of(table.path, names, "/"), top=True), request)


def level_of(path: Path | str, names: Sequence[str], separator: str) -> str:
    """The prefix of the group with the positions, "" for the top level."""
    levels: dict[str, str] = {}
    for name in names:
        prefix, found, last = name.rpartition(separator)
        if re.sub(r"[_.\[]?\d{1,9}\]?$", "", last.lower()) in ALIASES["q"]:
            levels.setdefault(prefix + found, name)
    if len(levels) > 1 and "" not in levels:
        raise LogError(
            f"{path}: {listed(list(levels.values()))} could each be the positions. Say which with "
            f"--columns, as in t=…,q={next(iter(levels.values()))}."
        )
    return "" if "" in levels or not levels else next(iter(levels))


#: Path of a known project's positions below the group of an episode → what reads one.
LAYOUTS = {ALOHA: read_aloha, f"{DROID_STATE}joint_positions": read_droid}


def layout_of(table: Hdf5Table) -> tuple[str, dict[int, str]]:
    """The layout of a file, "" for none, and each episode's group."""
    for anchor in LAYOUTS:
        own = [name for name in table.names if f"/{name}".endswith(f"/{anchor}")]
        if groups := sorted((name.removesuffix(anchor) for name in own), key=natural):
            return anchor, dict(zip(numbers_of(groups), groups, strict=True))
    return "", {0: ""}


def numbers_of(groups: Sequence[str]) -> Sequence[int]:
    """The episodes' numbers: ends of their groups' names, else from 0."""
    numbers = [int(end) for group in groups for end in re.findall(r"(\d{1,9})\D*$", group)]
    rising = numbers == sorted(set(numbers)) and len(numbers) == len(groups)
    return numbers if rising else range(len(groups))


def recognises(file: LogFile, _: LogFormat) -> bool:
    """Whether a folder holds DROID's episodes, at any depth."""
    if "metadata.yaml" in file.entries or (file.path / "meta" / "info.json").is_file():
        return False
    looked_at = itertools.islice(os.walk(file.path), MOST_LOOKED_AT)
    return any(TRAJECTORY in names for *_, names in looked_at)


@contextmanager
def episodes(file: LogFile) -> Iterator[Episodes]:
    """The logs of an HDF5 file or of DROID's folder."""
    if file.is_folder:
        # By the names of their folders.
        paths = sorted(file.path.rglob(TRAJECTORY), key=lambda path: path.parent.parts)
        if not paths:
            raise LogError(f"{file.path}: no {TRAJECTORY} in it or below.")
        each = {
            str(path.parent.relative_to(file.path)): partial(read_file, path) for path in paths
        }
        yield {k: partial(_placed, len(each) > 1, *one) for k, one in enumerate(each.items())}
        return
    with opened(file) as content:
        table = table_of(file.path, content)
        anchor, groups = layout_of(table)
        read, several = LAYOUTS.get(anchor, read_any), len(groups) > 1
        yield {
            k: partial(_placed, several, g, partial(read, table.within(g)))
            for k, g in groups.items()
        }


def read_file(path: Path, request: ReadChoice) -> RawLog:
    """Read an episode of DROID's folder."""
    raw = FORMATS["hdf5"].read(open_log(path), replace(request, episode=None))
    return replace(raw, part="", files=(path,))


def _placed(
    several: bool, place: str, read: Callable[[ReadChoice], RawLog], request: ReadChoice
) -> RawLog:
    """An episode, of several with a remark where it lies."""
    raw = read(request)
    said = (fact("episode-place", place=place.rstrip("/")),) if several else ()
    return replace(raw, remarks=(*said, *raw.remarks))


def episode_places(file: LogFile, columns: str | None) -> dict[int, str]:
    """Episode → group of its positions in an HDF5 file, as "observations/"."""
    stated = parse_columns(columns).item("q") if columns is not None else None
    with opened(file) as content:
        table = table_of(file.path, content)
        anchor, groups = layout_of(table)
        anchor = (stated.pattern if stated is not None else None) or anchor
        anchor = anchor or level_of(file.path, table.names, "/")
    return {k: group + anchor[: anchor.rfind("/") + 1] for k, group in groups.items()}
