"""XML of robot descriptions: hostile texts cost nothing and are refused on one line."""

from pathlib import Path

import pytest

from vftcli.robots.described import DEEPEST, xml_root
from vftcli.signals.errors import RobotError

BOMB = (
    "<!DOCTYPE r ["
    + '<!ENTITY a0 "boom">'
    + "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 12))
    + "]><robot>&a11;</robot>"
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BOMB, "has a document type 'r', which defines XML entities"),
        ('<!DOCTYPE r SYSTEM "file:///etc/passwd"><r/>', "has a document type 'r'"),
        ("<a>" * 100_000, "more than 500 elements within one another"),
        ("", "which is XML: no element found"),
        ("robot", "which is XML: syntax error"),
        ("<robot>&undefined;</robot>", "which is XML: undefined entity"),
        ("<x:robot/>", "which is XML: unbound prefix"),
        ("<robot>\x00</robot>", "which is XML: "),
    ],
)
def test_a_hostile_text_is_refused(text: str, words: str) -> None:
    with pytest.raises(RobotError, match=words):
        xml_root(text, Path("arm.urdf"))


def test_a_plain_text_is_its_elements() -> None:
    text = "<a>" * DEEPEST + "</a>" * DEEPEST
    assert sum(1 for _ in xml_root(text, Path("arm.urdf")).iter()) == DEEPEST
    assert xml_root("<a><b/><b x='1'/></a>", Path("arm.urdf"))[1].get("x") == "1"
