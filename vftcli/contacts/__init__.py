"""Contacts: what touched the arm, when, how hard, where, and how sure that is.

The room can be called: ``vft.contacts("log.csv", robot="ur5")`` is
`vftcli.notebook.contacts`.
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vftcli.contacts.contact_list import ContactList


class ContactsRoom(ModuleType):
    """This package as a module that can be called."""

    def __call__(self, *words: Any, **options: Any) -> "ContactList":  # noqa: ANN401
        """The contacts along a log; see `vftcli.notebook.contacts`."""
        # The notebook's call, several floors up.
        found: ContactList = import_module("vftcli.notebook").contacts(*words, **options)
        return found


contacts = sys.modules[__name__]
contacts.__class__ = ContactsRoom
