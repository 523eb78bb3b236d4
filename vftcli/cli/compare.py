"""`vftcli compare`: errors of the observers against a reference."""

from typing import Annotated

import typer

from vftcli.cli import options as opt
from vftcli.cli.bundles import Bundle, flag, taken_apart
from vftcli.cli.help import COMPARE, OUTPUT

MORE = "Intervals, lags and significance: --details"
"""What the tables on the terminal leave out."""


class TableOptions(Bundle):
    """The form of the table; one at most."""

    GROUP = OUTPUT

    json: opt.Json = False
    csv: bool = flag("--csv", "Print one row per observer and joint.")
    markdown: bool = flag("--markdown", "Print a Markdown table.")
    latex: bool = flag("--latex", "Print a LaTeX table (booktabs).")

    @property
    def form(self) -> str:
        """The one form that is asked for, or "terminal".

        Raises:
            typer.BadParameter: If several are.
        """
        asked = [name for name, wanted in self.words().items() if wanted]
        if len(asked) > 1:
            raise typer.BadParameter(f"choose one of {', '.join(f'--{name}' for name in asked)}")
        return asked[0] if asked else "terminal"


@taken_apart
def compare(
    logs: opt.Logs,
    reference: opt.RequiredReferenceOptions,
    analysis: opt.AnalysisOptions,
    table: TableOptions,
    significance: Annotated[
        bool,
        typer.Option(
            "--significance",
            help="Every pair of observers: difference, interval, p.",
            rich_help_panel=COMPARE,
        ),
    ] = False,
) -> None:
    """Print every observer's error against a reference, and its floor.

    Example: vftcli compare fixtures/ur5_circle.csv --robot ur5 --reference zero --interval 0:4
    """
    import polars as pl

    from vftcli.batch.kinds import for_comparison
    from vftcli.cli.console import LeftOut, say_analysis
    from vftcli.cli.jacobian import JacobianLogs
    from vftcli.evaluation import paired_significance
    from vftcli.evaluation.pooling import PoolMember, evaluate_pooled
    from vftcli.outputs.log import tables
    from vftcli.outputs.log.wrench_tables import paper_bounds
    from vftcli.pipeline import analyse_logs
    from vftcli.readers.library import Library

    show = {
        "json": tables.to_json,
        "csv": tables.to_csv,
        "markdown": tables.to_markdown,
        "latex": tables.to_latex,
    }
    library = Library(logs)
    choice = for_comparison(analysis.choice(library, reference))
    left_out, analyses = LeftOut(library, logs), []
    by_jacobian = JacobianLogs(left_out, choice)
    for made in analyse_logs(logs, choice, by_jacobian.told):
        if not table.json:
            say_analysis(made)
        analyses.append(made)
    if not (analyses or by_jacobian.judged):
        left_out.end(0)
    if significance:
        pairs = [
            paired_significance(a.recording.name, a.estimates, a.reference)
            for a in analyses
            if a.reference is not None
        ]
        if not pairs:
            raise typer.BadParameter("--significance compares observers, and none ran")
        typer.echo(tables.pairs_text(pl.concat(pairs), as_json=table.json))
        left_out.end(len(analyses))
        return
    errors = [a.errors for a in analyses if a.errors is not None]
    errors += [made.errors for made in by_jacobian.judged if made.errors is not None]
    members = [
        PoolMember(a.robot.name, a.estimates, a.reference)
        for a in analyses
        if a.reference is not None
    ]
    together = pl.concat([*errors, evaluate_pooled(members)], how="diagonal")
    rows, bounds = tables.marked(together, analyses), paper_bounds(analyses)
    if table.form == "terminal":
        text = tables.to_terminal(rows, bounds, every=analysis.talk.details)
        typer.echo(text if analysis.talk.details else f"{text}{MORE}")
    else:
        typer.echo(show[table.form](rows, bounds))
    left_out.end(len(errors))
