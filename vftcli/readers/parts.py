"""Parts: which of the several recordings of one file or folder is read, never in silence."""

from collections.abc import Sequence
from pathlib import Path

from vftcli.readers.reader import ReadChoice
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark, caution


def episode_of(
    path: Path | str, request: ReadChoice, numbers: Sequence[int]
) -> tuple[int, str, tuple[Remark, ...]]:
    """The episode that is read of those a file holds: the one asked for, else the first, and said.

    Returns:
        Its number, its name as a part ("" for the only one), and what is to be said of it.
    """
    number, count = request.episode, len(numbers)
    if number is not None and number not in numbers:
        there = f"{count} episodes, {numbers[0]} to {numbers[-1]}"
        there = f"1 episode, {numbers[0]}" if count == 1 else there
        raise LogError(f"{path}: no episode {number}; it holds {there} (--episode K|all).")
    taken = numbers[0] if number is None else number
    said = number is None and count > 1
    code = "episode-taken" if taken == 0 else "episode-taken-first"
    remarks = (caution(code, episode=taken, episodes=count),) if said else ()
    return taken, f"episode {taken}" if count > 1 else "", remarks


def arm_of(
    path: Path | str, request: ReadChoice, arms: Sequence[str], told: str = ""
) -> tuple[str, tuple[Remark, ...]]:
    """The arm that is read of a log of two: the one asked for; to look at, the first, and said."""
    if request.arm is not None and request.arm not in arms:
        raise LogError(f"{path}: holds the {arms[0]} arm alone; leave --arm out.")
    if request.arm is not None or len(arms) == 1:
        return request.arm or arms[0], ()
    if not request.examining:
        where = f" ({told})" if told else ""
        raise LogError(
            f"{path}: holds two arms{where}; say which with --arm {' or --arm '.join(arms)}."
        )
    taken = caution("arm-side-taken", arm=arms[0], other=arms[1], places=told or "by name")
    return arms[0], (taken,)


def refuse_arm(path: Path | str, request: ReadChoice) -> None:
    """Refuse ``--arm`` for a log of one arm."""
    if request.arm is not None:
        raise LogError(f"{path}: a log of one arm; leave --arm out.")
