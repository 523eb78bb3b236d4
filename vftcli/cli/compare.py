"""`vftcli compare`: errors of the observers against a reference."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.cli import options as opt
from vftcli.cli.analysis import AnalysisOptions
from vftcli.cli.console import LeftOut, echo, echo_data, say, say_analysis, say_json
from vftcli.evaluation.reference_choice import ReferenceChoice
from vftcli.signals.errors import VftError
from vftcli.signals.option import OUTPUT, WRITE, Option

if TYPE_CHECKING:
    from collections.abc import Sequence

    import polars as pl

    from vftcli.analysis import Analysis
    from vftcli.evaluation.wrenches import JacobianJudgement
    from vftcli.outputs.files import OutputFolder
    from vftcli.pipeline import AnalysisChoice

MORE = "Intervals, lags, pairs of observers: --details"  #: What screens leave out.


class TableOptions(opt.Bundle):
    """The form of the table; one at most."""

    GROUP = OUTPUT

    json: opt.Json
    csv: Annotated[bool, Option("--csv", "", "Print one row per observer and joint.")]
    markdown: Annotated[bool, Option("--markdown", "", "Print a Markdown table.")]
    latex: Annotated[bool, opt.LATEX]

    @property
    def form(self) -> str:
        """The one form that is asked for, or "terminal"."""
        asked = [name for name, wanted in vars(self).items() if wanted]
        if len(asked) > 1:
            raise typer.BadParameter(f"choose one of {', '.join(f'--{name}' for name in asked)}")
        return asked[0] if asked else "terminal"


class DrawnErrors(opt.Bundle):
    """The figure of the errors, and where it goes."""

    figures: opt.Figures
    output: Annotated[
        Path | None, Option("-o/--output", "DIR", "Folder for --figures.", group=WRITE)
    ]
    force: opt.Force

    def folder(self) -> "OutputFolder | None":
        """Where the figure goes, None where none is asked for."""
        if (self.figures is None) != (self.output is None):
            raise typer.BadParameter("--figures and -o DIR need each other: tables go to stdout")
        if self.output is None:
            return None
        from vftcli.outputs.figures import ERROR_FIGURES
        from vftcli.outputs.files import OutputFolder
        from vftcli.outputs.paper import figure_files

        folder = OutputFolder(self.output, self.force, figure_files(self.figures, ERROR_FIGURES))
        folder.check()
        return folder

    def write(self, errors: "pl.DataFrame") -> None:
        """Draw the errors, if that is asked for, and say where."""
        if (figures := self.folder()) is not None:
            from vftcli.outputs.figures import error_figures
            from vftcli.outputs.paper import write_figures

            with figures as folder:
                write_figures(folder, error_figures(errors), str(self.figures))
            say(f"wrote {self.output}: figures/errors-single.{self.figures}, errors-double")


def judged_by_jacobian(log: Path, error: VftError, choice: "AnalysisChoice") -> "JacobianJudgement":
    """What a vendor's torques beside a Jacobian tell; raises any other error."""
    from vftcli.evaluation.wrenches import judge_jacobian
    from vftcli.readers.references import jacobian_log
    from vftcli.readers.table import JacobianError

    if not isinstance(error, JacobianError):
        raise error
    read = jacobian_log(log, error, choice.read, choice.library.label(log))
    reference = choice.reference.name if choice.reference else None
    made = judge_jacobian(read, choice.wrench, reference)
    for remark in (*read.remarks, *made.remarks):
        say(f"note: {read.name}: {remark}")
    return made


def terminal_text(rows: "pl.DataFrame", analyses: "Sequence[Analysis]", *, details: bool) -> str:
    """The errors for the terminal, with details the pairs of observers below them."""
    import polars as pl

    from vftcli.evaluation import paired_significance
    from vftcli.outputs.error_tables import to_terminal
    from vftcli.outputs.grids import pairs_text

    text = to_terminal(rows, analyses, every=details)
    if not details:
        return text + MORE
    pairs = [
        paired_significance(a.recording.name, a.estimates, a.reference)
        for a in analyses
        if a.reference is not None
    ]
    return f"{text}\n{pairs_text(pl.concat(pairs))}" if pairs else text


@opt.command
def compare(
    logs: opt.Logs,
    reference: opt.Needed[ReferenceChoice],
    analysis: AnalysisOptions,
    table: TableOptions,
    drawn: DrawnErrors,
) -> None:
    """Print each observer's error against a reference.

    Example: vftcli compare fixtures/ur5_circle.csv --robot ur5 --reference zero --interval 0:4
    """
    from vftcli.answering import errors_of
    from vftcli.batch.log_work import for_comparison
    from vftcli.outputs.error_tables import FORMS
    from vftcli.outputs.run_record import all_remarks
    from vftcli.pipeline import analyse_logs
    from vftcli.readers.library import Library

    drawn.folder()
    library = Library(logs)
    choice = for_comparison(analysis.choice(library, reference))
    left_out, analyses, judged = LeftOut(library, logs), [], []

    def leave_out(log: Path, error: VftError) -> None:
        """Judge a vendor's torques by their Jacobian; leave any other log out."""
        try:
            judged.append(judged_by_jacobian(log, error, choice))
        except VftError as reason:
            left_out.add(log, reason)

    for made in analyse_logs(logs, choice, leave_out):
        if not table.json:
            say_analysis(made)
        analyses.append(made)
    if not (analyses or judged):
        left_out.end(0)
    rows = errors_of(analyses, [made.errors for made in judged])
    drawn.write(rows)
    if table.form == "terminal":
        echo(terminal_text(rows, analyses, details=analysis.talk.details))
    elif table.json:
        every = [remark for a in analyses for remark in all_remarks(a)]
        about = [
            {"recording": x.log.name, "path": str(x.log.path), "sha256": x.log.sha256}
            for x in judged
        ]
        say_json([*(a.recording for a in analyses), *about], every, rows=rows.to_dicts())
    else:
        echo_data(FORMS[table.form](rows, analyses))
    left_out.end(len(analyses) + len(judged))
