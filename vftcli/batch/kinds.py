"""A command's request on a log beside its options, alone and in a batch."""

from dataclasses import replace

from vftcli.observers.table import BEST
from vftcli.pipeline import AnalysisChoice


def for_estimates(choice: AnalysisChoice) -> AnalysisChoice:
    """The choice where estimates are written: contacts are listed with the wrench of `best`."""
    return replace(choice, contacts=choice.contacts and BEST in choice.observers.names)


def for_comparison(choice: AnalysisChoice) -> AnalysisChoice:
    """The choice where errors are printed: contacts are listed for the wrench, and to be judged."""
    judged = choice.reference is not None and choice.reference.contacts
    return replace(choice, contacts=choice.contacts and (choice.wrench is not None or judged))
