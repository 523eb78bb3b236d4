"""Figures drawn as a paper has them, and the names in their legends."""

from typing import Any

from vftcli.outputs.paper import WIDTHS, paper_style


def drawn(drawing: Any, width: str = "double") -> Any:
    with paper_style():
        figure = drawing.draw(WIDTHS[width])
        figure.draw_without_rendering()
    return figure


def names_in(figure: Any) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]
