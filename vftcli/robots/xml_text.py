"""The text of a robot description in XML, and its elements: no document types, no deep nesting."""

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from vftcli.signals.errors import RobotError

#: Elements within one another: a URDF has four, an MJCF one more than its arm has links.
DEEPEST = 500


class GuardedBuilder(ET.TreeBuilder):
    """A tree builder that takes no document type, which defines entities, and no deep nesting."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        self._depth = 0

    def doctype(self, name: str, public: str | None, system: str | None) -> None:
        """Refuse the document type, before what it defines is used."""
        del public, system
        raise RobotError(
            f"{self._path}: has a document type {name!r}, which defines XML entities; "
            "a robot description needs none: remove it"
        )

    def start(self, tag: str, attrs: dict[Any, Any], /) -> ET.Element:
        """Begin an element."""
        self._depth += 1
        if self._depth > DEEPEST:
            raise RobotError(f"{self._path}: more than {DEEPEST} elements within one another")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ET.Element:
        """End an element."""
        self._depth -= 1
        return super().end(tag)


def xml_root(text: str, path: Path) -> ET.Element:
    """The first element of an XML text."""
    parser = ET.XMLParser(target=GuardedBuilder(path))
    try:
        parser.feed(text)
        root: ET.Element = parser.close()
    except (ET.ParseError, ValueError) as error:
        raise RobotError(f"{path}: not a URDF, xacro or MJCF, which is XML: {error}") from None
    return root
