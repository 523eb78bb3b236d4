"""The papers that there are: another one is one more file and one more line here."""

from vftcli.reproduction.huang2025 import HUANG2025
from vftcli.reproduction.paper import Paper
from vftcli.signals.errors import ParameterError

PAPERS: dict[str, Paper] = {HUANG2025.name: HUANG2025}  #: Name at the command line → the paper.


def paper_of(name: str) -> Paper:
    """The paper of this name."""
    if name not in PAPERS:
        raise ParameterError(f"no paper {name!r}; there is {', '.join(PAPERS)}")
    return PAPERS[name]
