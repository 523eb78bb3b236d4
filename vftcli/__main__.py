"""``python -m vftcli``: the command line, where its script is not on the path."""

from vftcli.cli import launch

launch()
