"""`vftcli compare`: errors of the observers against a reference."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.cli import options as opt
from vftcli.cli.console import LeftOut, echo, echo_data, say, say_analysis, say_json
from vftcli.evaluation import ReferenceChoice
from vftcli.signals.errors import VftError
from vftcli.signals.option import COMPARE, WRITE, Asked, Option

if TYPE_CHECKING:
    from collections.abc import Sequence

    import polars as pl

    from vftcli.analysis import Analysis
    from vftcli.evaluation.references import JacobianJudgement
    from vftcli.outputs.files import OutputFolder

MORE = "Intervals, delays, pairs: --details. The observers: vftcli help observers"


def figure_folder(figures: str | None, output: Path | None, force: bool) -> "OutputFolder | None":
    """The folder of the figure of the errors, None without a figure."""
    if (figures is None) != (output is None):
        raise typer.BadParameter("--figures and -o DIR need each other: tables go to stdout")
    if output is None:
        return None
    from vftcli.outputs.figures import ERROR_FIGURES
    from vftcli.outputs.files import OutputFolder
    from vftcli.outputs.paper import figure_files

    folder = OutputFolder(output, force, figure_files(figures, ERROR_FIGURES))
    folder.check()
    return folder


def print_errors(
    form: str,
    rows: "pl.DataFrame",
    analyses: "Sequence[Analysis]",
    judged: "Sequence[JacobianJudgement]",
    *,
    details: bool,
) -> None:
    """Print the errors in a form; in details pairs of observers too."""
    import polars as pl

    from vftcli.evaluation.errors import POOLED
    from vftcli.evaluation.intervals import paired_significance
    from vftcli.outputs.error_tables import FORMS, to_terminal
    from vftcli.outputs.grids import pairs_text
    from vftcli.outputs.run_record import all_remarks
    from vftcli.outputs.screen import MOST_LINES

    if form == "terminal":
        text = to_terminal(rows, every=details)
        judging = [(a, a.reference) for a in analyses if a.reference is not None]
        if not details:
            pooled = rows.filter(recording=POOLED)
            if text.count("\n") >= MOST_LINES and len(pooled):
                text = f"{to_terminal(pooled, every=False)}Each log by itself: --details\n"
            text += MORE
        elif judging:
            pairs = [paired_significance(a.recording.name, a.estimates, r) for a, r in judging]
            text += f"\n{pairs_text(pl.concat(pairs))}"
        echo(text)
    elif form == "json":
        every = [remark for a in analyses for remark in all_remarks(a)]
        about = [
            {"recording": x.log.name, "path": str(x.log.path), "sha256": x.log.sha256}
            for x in judged
        ]
        say_json([*(a.recording for a in analyses), *about], every, rows=rows.to_dicts())
    else:
        echo_data(FORMS[form](rows))


@opt.command(ReferenceChoice, *opt.OF_ANALYSIS, opt.TableForm)
def compare(
    logs: opt.Logs,
    reference: Annotated[str, ReferenceChoice.option("reference", group=COMPARE)],
    asked: Asked,
    figures: opt.Figures,
    output: Annotated[
        Path | None, Option("-o/--output", "DIR", "Folder for --figures.", group=WRITE)
    ],
    force: opt.Force,
) -> None:
    """Print each observer's error against a reference.

    Example: vftcli compare fixtures/ur5_circle.csv --robot ur5 --reference zero --interval 0:4
    """
    from vftcli.answering import errors_of
    from vftcli.evaluation.references import judge_jacobian
    from vftcli.outputs.figures import error_figures
    from vftcli.outputs.paper import write_figures
    from vftcli.pipeline import analyse_logs, for_comparison
    from vftcli.readers.reading import Library
    from vftcli.readers.references import jacobian_log
    from vftcli.readers.table import JacobianError

    folder, form = figure_folder(figures, output, force), opt.form_of(asked)
    library = Library(logs)
    choice = for_comparison(opt.choice_for(asked, library))
    left_out, analyses, judged = LeftOut(library, logs), [], []

    def leave_out(log: Path, error: VftError) -> None:
        """Judge a vendor's torques by their Jacobian, else leave the log out."""
        try:
            if not isinstance(error, JacobianError):
                raise error
            read = jacobian_log(log, error, choice.read, library.label(log))
            made = judge_jacobian(read, choice.wrench, reference)
        except VftError as reason:
            left_out.add(log, reason)
            return
        for remark in (*read.remarks, *made.remarks):
            say(f"note: {read.name}: {remark}")
        judged.append(made)

    for made in analyse_logs(logs, choice, leave_out):
        if form != "json":
            say_analysis(made)
        analyses.append(made)
    if not (analyses or judged):
        left_out.end(0)
    rows = errors_of(analyses, [made.errors for made in judged])
    if folder is not None:
        with folder:
            write_figures(folder, error_figures(rows), str(figures))
        say(f"wrote {output}: figures/errors-single.{figures}, errors-double")
    print_errors(form, rows, analyses, judged, details=asked.words["details"])
    left_out.end(len(analyses) + len(judged))
