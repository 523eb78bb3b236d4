"""The report: one HTML page that needs nothing but a browser, and the index over several."""

from vftcli.outputs.page.page import render, render_index

__all__ = ["render", "render_index"]
