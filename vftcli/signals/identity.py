"""Which recordings are of one run: a run beside its own copy measures nothing, so it is refused."""

from collections.abc import Sequence
from itertools import combinations

from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.recording import Recording


def same_run(one: Recording, other: Recording) -> bool:
    """Whether two recordings were read from equal bytes, whatever the files are called.

    A span of a recording is the same run as the whole. Two recordings that one file holds one
    after the other are two runs if its clock tells them apart, or if they are two of its parts.
    """
    if one is other:
        return True
    mine, theirs = one.source, other.source
    if (mine.rows, mine.t0, mine.part) != (theirs.rows, theirs.t0, theirs.part):
        return False  # so that nobody waits for the digest of a large file to hear this
    return bool(mine.sha256) and mine.sha256 == theirs.sha256


def refuse_repeated_logs(logs: Sequence[Recording], option: str = "LOG") -> None:
    """Refuse logs of one command that are the same run: their agreement would count as evidence."""
    for one, other in combinations(logs, 2):
        if same_run(one, other):
            raise ParameterError(
                f"{one.name} and {other.name}, each given as {option}, are the same run (equal "
                "sha256), which says nothing new the second time; give each run once"
            )


def refuse_repeated_runs(recording: Recording, free: Sequence[Recording]) -> None:
    """Refuse free runs that are the log itself, or one another."""
    for run in free:
        if same_run(recording, run):
            raise ReferenceTorqueError(
                f"{run.name} is the log itself (equal sha256): a free run is another log of the "
                "same motion; for free cycles within one log leave --free away"
            )
    for one, other in combinations(free, 2):
        if same_run(one, other):
            raise ReferenceTorqueError(
                f"{one.name} and {other.name} are the same run (equal sha256), so they agree "
                "whatever their error; give each free run once"
            )
