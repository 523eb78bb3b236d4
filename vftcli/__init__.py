"""vftcli: external forces from recorded robot logs, with their errors."""

__version__ = "0.1.0"
