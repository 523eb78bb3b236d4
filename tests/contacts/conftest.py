"""What the tests of the contacts share: the lists of the fixtures."""

from collections.abc import Callable

import pytest
from contact_logs import FIXTURES, motion

from vftcli.contacts.contact_list import ContactList
from vftcli.contacts.listing import list_contacts
from vftcli.readers.reading import read

Lister = Callable[..., ContactList]


@pytest.fixture(scope="session")
def listed() -> Lister:
    """The contacts of a fixture, found once a session."""
    made: dict[tuple[str, str, str | None], ContactList] = {}

    def call(name: str, robot: str, free: str | None = None) -> ContactList:
        key = (name, robot, free)
        if key not in made:
            made[key] = list_contacts(motion(read(FIXTURES / name), robot, free))
        return made[key]

    return call
