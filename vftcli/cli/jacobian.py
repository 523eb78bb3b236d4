"""Logs of a vendor's torques beside a Jacobian, among the logs of a command."""

from pathlib import Path
from typing import TYPE_CHECKING

from vftcli.cli.console import command_line, say, show
from vftcli.cli.progress import echo

if TYPE_CHECKING:
    from vftcli.cli.console import LeftOut
    from vftcli.evaluation.logged_jacobian import JacobianJudgement
    from vftcli.pipeline import AnalysisChoice
    from vftcli.readers.table import JacobianError
    from vftcli.signals.errors import VftError


class JacobianLogs:
    """Takes such logs out of those that cannot be analysed.

    Attributes:
        judged: What each of them tells.
    """

    def __init__(self, left_out: "LeftOut", choice: "AnalysisChoice") -> None:
        self._left_out, self._choice = left_out, choice
        self.judged: list[JacobianJudgement] = []

    def told(self, log: Path, error: "VftError") -> None:
        """Judge the log by its Jacobian if it has one, else say that it is left out."""
        from vftcli.readers.table import JacobianError
        from vftcli.signals.errors import VftError

        if isinstance(error, JacobianError):
            try:
                self.judged.append(judged(log, error, self._choice))
            except VftError as other:
                error = other
            else:
                return
        self._left_out.told(log, error)


def judged(log: Path, found: "JacobianError", choice: "AnalysisChoice") -> "JacobianJudgement":
    """What such a log tells of what is asked; what the numbers are is said."""
    from vftcli.evaluation.logged_jacobian import judge_jacobian
    from vftcli.readers.jacobian import jacobian_log

    read = jacobian_log(log, found, choice.read, choice.library.label(log))
    reference = choice.reference.name if choice.reference is not None else None
    made = judge_jacobian(read, choice.wrench, reference)
    for remark in (*read.remarks, *made.remarks):
        say(f"note: {read.name}: {remark}")
    return made


def write_by_jacobian(
    log: Path,
    found: "JacobianError",
    choice: "AnalysisChoice",
    output: Path,
    *,
    force: bool,
    json: bool,
) -> None:
    """Write what there is of such a log, where a wrench or a reference is asked for."""
    from vftcli.outputs.log.report import write_jacobian_folder
    from vftcli.outputs.log.tables import to_terminal

    if choice.wrench is None and choice.reference is None:
        raise found
    made = judged(log, found, choice)
    record = write_jacobian_folder(output, made, command_line(), force=force)
    if json:
        echo(record)
        return
    if made.errors is not None:
        show(to_terminal(made.errors, every=False))
    say(f"{output}: estimates.parquet and run.json; no page and no recording without positions")
