"""``vftcli`` and ``python -m vftcli``: an interrupt is no traceback while it loads."""

import signal
from importlib import import_module

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
launch = import_module("vftcli.cli").launch
if __name__ == "__main__":
    launch()
