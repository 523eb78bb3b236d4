"""How a Rerun recording opens: the arm and the words to the left, plots joint by joint."""

from typing import Any, NamedTuple

from vftcli.outputs.log.rerun_text import drawable


class Plot(NamedTuple):
    """One time plot.

    Attributes:
        path: The entity it shows.
        name: Its title, with the unit.
        low: Lower end of its vertical axis, in its unit.
        high: Upper end.
    """

    path: str
    name: str
    low: float
    high: float


class Tab(NamedTuple):
    """Plots shown together.

    Attributes:
        name: The tab's name.
        plots: Its plots.
    """

    name: str
    plots: tuple[Plot, ...]


class Scene(NamedTuple):
    """Where to look from.

    Attributes:
        eye: Position of the eye in the base frame. [m]
        centre: What it looks at. [m]
    """

    eye: tuple[float, ...]
    centre: tuple[float, ...]


def arrangement(tabs: tuple[Tab, ...], scene: Scene) -> Any:  # noqa: ANN401 - Rerun is untyped
    """The blueprint for plots and an arm in its space."""
    import rerun.blueprint as rrb

    eye = rrb.EyeControls3D(position=scene.eye, look_target=scene.centre)
    view = rrb.Spatial3DView(
        origin="/robot",
        contents="/robot/**",
        name="Arm",
        eye_controls=eye,
        line_grid=rrb.LineGrid3D(visible=True, spacing=0.1),
    )
    words = rrb.Tabs(
        rrb.TextDocumentView(origin="/summary", name="Summary"),
        rrb.TextDocumentView(origin="/errors", name="Errors"),
        active_tab=0,
    )
    plots = rrb.Tabs(*(grid(tab) for tab in tabs), active_tab=0)
    left = rrb.Vertical(view, words, row_shares=[3, 2])
    return rrb.Blueprint(
        rrb.Horizontal(left, plots, column_shares=[2, 5]),
        rrb.TimePanel(timeline="t", state="collapsed", play_state="paused"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def grid(tab: Tab) -> Any:  # noqa: ANN401 - Rerun is untyped
    """One tab, in two columns if there are many plots; the first one's legend holds for all."""
    import rerun.blueprint as rrb

    views = [time_plot(plot, legend=plot is tab.plots[0]) for plot in tab.plots]
    return rrb.Grid(*views, grid_columns=2 if len(views) > 3 else 1, name=tab.name)


def time_plot(plot: Plot, legend: bool) -> Any:  # noqa: ANN401 - Rerun is untyped
    """One plot whose time axis moves with all the others."""
    import rerun.blueprint as rrb

    return rrb.TimeSeriesView(
        origin=plot.path,
        name=drawable(plot.name),
        plot_legend=rrb.PlotLegend(rrb.Corner2D.LeftTop, visible=legend),
        axis_x=rrb.archetypes.TimeAxis(link="LinkToGlobal"),
        axis_y=rrb.ScalarAxis(range=(plot.low, plot.high)),
    )
