"""``python -m vftcli``: the command line without its script on the path."""

from vftcli.cli import launch

launch()
