"""Contact and ContactList: the answer to what touched the arm."""

from collections.abc import Iterator, Sequence, Set
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, seal
from vftcli.signals.parsing import counted
from vftcli.signals.remarks import Remark, Where, caution, warning
from vftcli.signals.rest import faster
from vftcli.signals.shown import UNKNOWN, Shown, joined, record, value_text

if TYPE_CHECKING:
    import polars as pl
    from matplotlib.figure import Figure

    from vftcli.contacts.free_statistics import Basis
    from vftcli.contacts.windows import ArmPart
    from vftcli.free_motion.free_motion import FreeLoad
    from vftcli.robots.run import Run
    from vftcli.wrench.smoother import WrenchPrior

Trust = Literal["good", "fair", "weak"]  #: Trust in a row.
#: Evidence and band of a row that is good; a wider band makes it weak.
SURE_NATS, TIGHT, WIDE = 50.0, 0.25, 0.4
#: An axis that sees only larger forces is blind. [N]
BLIND = 500.0
#: Share to which a load weighs as much as the file's payload.
SAME_MASS = 0.1
#: Fields of a contact that are unknown where no wrench is.
OF_FORCES = (
    "peak_force", "peak_band", "place_band", "wrench", "wrench_sd", "mean_force", "impulse",
    "anywhere", "course", "vendor_force",
)  # fmt: skip
#: Field of a contact → its keys in a record, in order.
KEYS = {
    "number": "number", "kind": "kind", "start": "start_s", "stop": "stop_s", "peak": "peak_s",
    "peak_force": "peak_force_N", "peak_band": "peak_force_band_N", "place_band": "place_band_N",
    "force": "force_N", "force_sd": "force_sd_N", "moment": "moment_Nm",
    "moment_sd": "moment_sd_Nm", "mean_force": "mean_force_N", "impulse": "impulse_Ns",
    "where": "where", "lead": "where_lead_nats", "places": "places", "anywhere": "anywhere_N",
    "trust": "trust", "size_known": "size_known", "evidence": "evidence_nats",
    "joint_torque": "joint_torque_Nm", "joint_torque_sd": "joint_torque_sd_Nm",
    "at_rest": "at_rest", "remarks": "remarks", "vendor_force": "vendor_force_N",
    "sensor_force": "sensor_force_N",
}  # fmt: skip
#: Columns that a table of contacts has even where it has no row.
FIRST_COLUMNS = ("number", "start_s", "stop_s", "peak_s", "peak_force_N")


class ForceCourse(NamedTuple):
    """|F| of a contact from its start to its end."""

    t: Array  #: Time. (K,) [s]
    force: Array  #: |F|. (K,) [N]
    band: Array  #: Half width of its 95 % band. (K,) [N]


@record
class Contact(Shown):
    """A contact: force and moment ON the robot, base axes, about the flange point.

    Bands and standard deviations are calibrated: they include the model's error.
    """

    number: int  #: From 1, in the order of time.
    start: float  #: When it begins. [s]
    stop: float  #: When it ends. [s]
    peak: float  #: When |F| is largest. [s]
    #: Whether it is a load, or a wrong model; its numbers are then means.
    is_load: bool = False
    peak_force: float | None  #: |F| at the peak. [N]
    #: Half width of its 95 % band, what the place may change in it. [N]
    peak_band: float | None
    place_band: float | None  #: Half width of its 95 % band at the best place. [N]
    wrench: Array | None  #: Force and moment at the peak. (6,) [N, N·m]
    wrench_sd: Array | None  #: Standard deviation. (6,) [N, N·m]
    mean_force: Array | None  #: Mean force. (3,) [N]
    impulse: Array | None  #: ∫F dt. (3,) [N·s]
    #: Smallest and largest |F| of the places that fit, with bands. [N]
    anywhere: tuple[float, float] | None
    where: "ArmPart"  #: Part of the arm.
    #: Evidence of its best place less that of every other part. [nats]
    lead: float | None
    places: tuple[int, ...]  #: Links that fit; 0 is the flange.
    evidence: float | None  #: Best place's evidence over nothing. [nats]
    joint_torque: Array  #: Torque on each joint at the peak. (n,) [N·m]
    joint_torque_sd: Array  #: Its standard deviation. (n,) [N·m]
    at_rest: bool  #: Whether no joint moves at the peak.
    #: |F| by the log's own torque at the peak. [N]
    vendor_force: float | None = None
    #: |F| by the log's own wrench at the peak. [N]
    sensor_force: float | None = None
    course: ForceCourse | None = None  #: |F| from start to end, or None.
    #: Whether neither free motion nor a reference checks its size.
    inferred: bool = False
    remarks: tuple[Remark, ...] = ()  #: Limits of this row.

    def __post_init__(self) -> None:
        torques = "joint_torque", "joint_torque_sd"
        seal(self, "wrench", "wrench_sd", "mean_force", "impulse", *torques)

    def _headline(self) -> str:
        kind = "load" if self.is_load else "contact"
        when = f"{self.start:.2f} to {self.stop:.2f} s"
        return f"{self.number}, a {kind}: {when}, {self.size}, {self.where} ({self.trust})"

    def _rows(self) -> Iterator[Sequence[object]]:
        yield "field", "value"
        for key, value in self.record().items():
            shown = value if isinstance(value, (str, float, int)) else value_text(value)
            yield key, UNKNOWN if shown == "" else shown

    @property
    def size(self) -> str:
        """|F| at the peak with its band or range, or joint torques."""
        if self.peak_force is None:
            return f"{joined(self.joint_torque)} N·m"
        if self.place_unknown and self.anywhere:
            return f"{self.anywhere[0]:.0f}–{self.anywhere[1]:.0f} N"
        return f"{self.peak_force:.0f} ± {self.peak_band:.0f} N"

    def record(self) -> dict[str, Any]:
        """The contact for machines, units in the names."""
        parts: dict[str, Any] = {
            "kind": "load" if self.is_load else "contact",
            "places": [link or "flange" for link in self.places],
            "anywhere_N": None if self.anywhere is None else list(self.anywhere),
            "remarks": list(self.remarks),
        }
        for sd, wrench in (("", self.wrench), ("_sd", self.wrench_sd)):
            force, moment = (None, None) if wrench is None else np.split(wrench, 2)
            parts |= {f"force{sd}_N": force, f"moment{sd}_Nm": moment}
        return {key: parts.get(key, getattr(self, name, None)) for name, key in KEYS.items()}

    def row(self) -> dict[str, Any]:
        """The record in one row: ``force_N_x`` …, joints by number."""
        row: dict[str, Any] = {}
        for key, value in self.record().items():
            if isinstance(value, np.ndarray):
                axes = "xyz" if len(value) == 3 else range(1, len(value) + 1)
                row |= {f"{key}_{axis}": v for axis, v in zip(axes, value, strict=True)}
            elif key == "anywhere_N":
                low, high = value or (None, None)
                row |= {"anywhere_least_N": low, "anywhere_most_N": high}
            elif isinstance(value, list):
                row[key] = " ".join(str(item) for item in value)
            else:
                row[key] = value
        return row

    @property
    def size_known(self) -> bool:
        """Whether its force exceeds its band and its place is known."""
        size, band = self.peak_force, self.peak_band
        return not (size is None or band is None or self.place_unknown or size <= band)

    @property
    def place_unknown(self) -> bool:
        """Whether its size depends on an unknown place."""
        return any(remark.code == "size-goes-with-place" for remark in self.remarks)

    @property
    def goes_with_place(self) -> bool:
        """Whether another place changes its force by more than `WIDE` of it."""
        size = self.peak_force or 0.0
        return any(abs(end - size) > WIDE * size for end in self.anywhere or ())

    @property
    def trust(self) -> Trust:
        """Trust in the row's size, by evidence, band and remarks."""
        force, narrow, wide = self.peak_force, self.place_band, self.peak_band
        doubted = self.remarks or self.is_load or (self.evidence or 0.0) < SURE_NATS
        if doubted or force is None or narrow is None or wide is None:
            return "weak"
        size = max(force, 1e-9)
        if narrow > WIDE * size:
            return "weak"
        is_sure = wide <= TIGHT * size and not self.inferred
        return "good" if is_sure and not self.goes_with_place else "fair"


def numbered(rows: Sequence[Contact], *, inferred: bool) -> tuple[Contact, ...]:
    """The rows in the order of time with their numbers, from 1."""
    ordered = enumerate(sorted(rows, key=lambda row: row.start), 1)
    return tuple(replace(row, number=k, inferred=inferred) for k, row in ordered)


class CarriedLoad(NamedTuple):
    """A load that the model lacks; it is in no row."""

    mass: float  #: Its mass. [kg]
    sd: float  #: Standard deviation of the mass. [kg]
    robot: str  #: The model's name.
    #: The robot's payload that weighs as much, if any.
    payload: str | None
    #: From first to last motion, in which it is weighed. [s]
    span: tuple[float, float]

    @classmethod
    def of(cls, load: "FreeLoad", run: "Run") -> "CarriedLoad":
        """A log's load, with the robot's payload that weighs as much."""
        moves = run.t[faster(run.dq).any(axis=1)]
        ends = moves if len(moves) else run.t
        apart = [(abs(p.mass - load.mass), name) for name, p in run.robot.payloads.items()]
        off, name = min(apart, default=(np.inf, None))
        alike = name if off <= max(2.0 * load.sd, SAME_MASS * load.mass) else None
        return cls(load.mass, load.sd, run.robot.name, alike, (ends[0], ends[-1]))

    def record(self) -> dict[str, Any]:
        """The load for machines, units in the names."""
        keys = "mass_kg", "mass_sd_kg", "robot", "payload", "span_s"
        return dict(zip(keys, self, strict=True))


class Unexplained(NamedTuple):
    """The largest torque that the robot's model does not explain."""

    torque: float  #: Its size. [N·m]
    joint: int  #: Of which joint, from 1.
    at: float  #: When. [s]


@record
class ContactModel(Shown):
    """Noise model behind a list, for `run.json`."""

    #: Prior of the contacts' wrench, if learned.
    prior: "WrenchPrior | None"
    noise_sd: Array  #: √R of each joint. (n,) [N·m]
    error_sd: Array  #: Standard deviation of the model error. (n,) [N·m]
    error_time: Array  #: Its correlation time. (n,) [s]
    block: float  #: Length of a block. [s]


@record
class ContactList(Shown):
    """The contacts along a log: a sequence of `Contact`."""

    recording: str  #: The log's label.
    duration: float  #: Its length. [s]
    contacts: tuple[Contact, ...]  #: The contacts, in the order of time.
    #: Possible contacts, of less evidence.
    candidates: tuple[Contact, ...] = ()
    basis: "Basis"  #: Tells contact from model error.
    #: Remarks on known free motion.
    free: tuple[Remark, ...] = ()
    free_seconds: float = 0.0  #: Length of the free motion. [s]
    #: Contacts listed in the log's own free part, if any.
    false_on_free: int | None = None
    threshold: float | None = None  #: Least evidence of a contact. [nats]
    #: The smallest force that this log can tell. [N]
    smallest_force: float | None = None
    #: The largest torque if nothing can be listed, else None.
    unexplained: Unexplained | None = None
    #: A load that the model lacks, None where none shows.
    load: CarriedLoad | None = None
    #: When the arm stopped too abruptly for a contact. [s]
    stops: tuple[float, ...] = ()
    model: ContactModel  #: Noise model behind the list.
    remarks: tuple[Remark, ...] = ()  #: Limits of the whole list.

    def __getitem__(self, place: int) -> Contact:
        """The contact at a place of the list, from 0."""
        return self.contacts[place]

    def __len__(self) -> int:
        """The number of contacts."""
        return len(self.contacts)

    def __bool__(self) -> bool:
        """True, even if nothing touched the log."""
        return True

    def _headline(self) -> str:
        listed, hardest = counted(len(self), "contact"), self.hardest
        last = f", the hardest {hardest.size} at {hardest.peak:.2f} s" if hardest else ""
        return f"of {self.recording}: {listed} in {self.duration:.4g} s{last}"

    def _rows(self) -> Iterator[Sequence[object]]:
        yield "#", "from – to [s]", "|F| at its peak", "force x y z [N]", "where", "trust"
        for c in self.contacts:
            force = UNKNOWN if c.wrench is None else " ".join(f"{f:.0f}" for f in c.wrench[:3])
            yield c.number, f"{c.start:.2f} – {c.stop:.2f}", c.size, force, c.where, c.trust

    def to_polars(self) -> "pl.DataFrame":
        """One row a contact, the columns of ``contacts.csv``."""
        import polars as pl

        if not self.contacts:
            return pl.DataFrame(schema=dict.fromkeys(FIRST_COLUMNS, pl.Float64))
        return pl.DataFrame([c.row() for c in self.contacts], infer_schema_length=None)

    def plot(self) -> "Figure":
        """A matplotlib figure of each contact's |F| and band."""
        figures = import_module("vftcli.outputs.figures")
        figure: Figure = figures.on_paper(figures.force_drawing(self))
        return figure

    def weighed(self, load: tuple[float, float] | None, doubts: Set[str]) -> "ContactList":
        """The list, given the load [kg] with its SD and the findings in doubt."""
        carried, rows, others = self.load, self.contacts, self.candidates
        if carried and load:
            carried = carried._replace(mass=load[0], sd=load[1])
        if doubts:
            why = caution("size-in-doubt")
            rows = tuple(replace(row, remarks=(*row.remarks, why)) for row in rows)
        if "zero-effort" in doubts:
            rows, others = (), numbered((*rows, *others), inferred=True)
        return replace(self, load=carried, contacts=rows, candidates=others)

    def without_forces(self) -> "ContactList":
        """The list of an arm with too few joints for a wrench."""
        nothing: dict[str, Any] = dict.fromkeys(OF_FORCES)
        rows, weak = (
            tuple(replace(row, **nothing) for row in part)
            for part in (self.contacts, self.candidates)
        )
        remarks = (*self.remarks, caution("no-wrench-of-few-joints"))
        return replace(self, contacts=rows, candidates=weak, smallest_force=None, remarks=remarks)

    def not_free(self, t: Array) -> Iterator[Remark]:
        """A warning if a log (T,) [s] is not free, with its longest free span."""
        if not self.contacts:
            return
        worst = self.hardest or self.contacts[0]
        edges = [t[0], *(x for row in self.contacts for x in (row.start, row.stop)), t[-1]]
        spans = zip(edges[::2], edges[1::2], strict=True)
        begin, end = max(spans, key=lambda span: span[1] - span[0])
        yield warning(
            "reference-zero-touched",
            Where(span=(worst.start, worst.stop)),
            size=worst.size,
            spans=len(self),
            # Inwards, so that the span holds no contact.
            begin_s=np.ceil(10.0 * begin) / 10.0,
            end_s=np.floor(10.0 * end) / 10.0,
        )

    @property
    def tells_untouched(self) -> bool:
        """Whether nothing touches the arm outside the rows, by free motion."""
        # A candidate alone may be a touch that the model hides.
        if self.basis != "free motion" or (self.candidates and not self.contacts):
            return False
        return not any(contact.is_load for contact in self.contacts)

    @property
    def detectable_force(self) -> float | None:
        """`smallest_force`, None without one or where an axis is blind. [N]"""
        least = self.smallest_force
        return least if least is not None and least < BLIND else None

    @property
    def hardest(self) -> Contact | None:
        """The contact with the largest known force, else the largest of all."""
        felt = [contact for contact in self.contacts if contact.peak_force is not None]
        return max(felt, key=lambda c: (c.size_known, c.peak_force or 0.0), default=None)
