"""Xacro: expanded with arguments, its packages found, and what is refused."""

import sys
from pathlib import Path

import pytest
from made_urdfs import arm, fixed, link, robot, written

from vftcli.robots import described, load_robot
from vftcli.signals.errors import RobotError

HEAD = """<robot name="$(arg name)" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="gripper" default="false"/>
<xacro:property name="mass" value="${2 * 0.5}"/>
"""


def xacro(inside: str = "") -> str:
    hand = f'<xacro:if value="$(arg gripper)">{fixed("hand", "link5", 0.5)}</xacro:if>'
    body = link("base") + arm(5).replace('mass value="5.0"', 'mass value="${mass}"')
    return f"{HEAD}{body}{hand}{inside}</robot>"


@pytest.fixture
def _xacro_installed() -> None:
    pytest.importorskip("xacro", reason="the extra vftcli[xacro] is not installed")
    pytest.importorskip("xacrodoc", reason="the extra vftcli[xacro] is not installed")


@pytest.mark.usefixtures("_xacro_installed")
def test_a_xacro_is_expanded_with_its_arguments(tmp_path: Path) -> None:
    path = written(tmp_path, xacro(), "arm.urdf.xacro")
    bare = load_robot(f"{path} name:=made")
    assert (bare.name, bare.joints, bare.chain.mass[0]) == ("made", 5, 1.0)
    held = load_robot(f"{path} name:=made gripper:=true")
    assert held.chain.mass[-1] - bare.chain.mass[-1] == pytest.approx(0.5)
    assert bare.remarks[0].code == "xacro-run"
    # A file that holds macros is a xacro whatever it is called.
    assert load_robot(f"{written(tmp_path, xacro())} name:=made").name == "made"


@pytest.mark.slow
@pytest.mark.usefixtures("_xacro_installed")
@pytest.mark.parametrize(
    ("text", "arguments", "words"),
    [
        (xacro(), "", "the xacro needs name: .*name:=VALUE'; it takes name, gripper"),
        (xacro(), "name:=m griper:=1", r"no argument 'griper'\. Did you .* takes name, gripper"),
        (xacro("$(arg tool)"), "name:=made", "the xacro needs tool: .*tool:=VALUE"),
        (xacro('<xacro:include filename="$(find nowhere)/x.xacro"/>'), "name:=made", "nowhere"),
        (xacro("${1 / 0}"), "name:=made", "cannot be expanded: .*division by zero"),
        (xacro("${__import__('os')}"), "name:=made", "cannot be expanded: "),
        (xacro('<xacro:include filename="arm.xacro"/>'), "name:=made", "cannot be expanded: "),
        (xacro("${'a' * 10 ** 12}"), "name:=made", r"cannot be expanded: .*10 \*\* 12"),
        (xacro("$(env HOME)"), "name:=made", "it reads the environment variable HOME"),
        (xacro("${xacro.load_yaml('/etc/passwd')}"), "name:=made", "/etc/passwd, which is out"),
        (xacro("${load_yaml('../beside.yaml')}"), "name:=made", r"\./beside\.yaml, which is out"),
    ],
)
def test_a_xacro_that_cannot_be_expanded_says_why_on_one_line(
    text, arguments, words, tmp_path, capfd
) -> None:
    with pytest.raises(RobotError, match=words) as caught:
        load_robot(f"{written(tmp_path, text, 'arm.xacro')} {arguments}".strip())
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
@pytest.mark.usefixtures("_xacro_installed")
@pytest.mark.parametrize("name", ["arm.xacro", "arm.urdf"])
def test_a_xacro_that_never_ends_is_ended(tmp_path, monkeypatch, name: str) -> None:
    """9^9^9 has 370 million digits: hours of a processor, in one step of the interpreter."""
    monkeypatch.setattr(described, "SECONDS", 1)
    path = written(tmp_path, xacro("${9**9**9}"), name)
    with pytest.raises(RobotError, match="cannot be expanded within 1 s of a processor"):
        load_robot(f"{path} name:=made")


@pytest.mark.usefixtures("_xacro_installed")
def test_a_maker_s_package_loads_its_tables_and_those_of_a_package_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As UR's description does: arguments name the files, a macro of another folder loads them.

    A package is found by its manifest, and what it includes may declare arguments.
    """
    monkeypatch.setenv("ARM_MASS", "9.0")
    own, other = tmp_path / "own_description", tmp_path / "beside"
    for folder in (own / "urdf" / "inc", own / "config", other / "config"):
        folder.mkdir(parents=True)
    written(own, "<package><name>own_description</name></package>", "package.xml")
    written(other, "<package><name>other_description</name></package>", "package.xml")
    written(own / "config", "masses: {link: !degrees 57.29577951308232}\n", "physical.yaml")
    written(other / "config", "tool: 0.25\n", "tool.yaml")
    macro = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="far" default="1"/>
<xacro:macro name="read" params="physical tool">
<xacro:property name="table" value="${xacro.load_yaml(physical)}" scope="parent"/>
<xacro:property name="tool" value="${$(arg far) * xacro.load_yaml(tool)['tool']}" scope="parent"/>
</xacro:macro></robot>"""
    written(own / "urdf" / "inc", macro, "common.xacro")
    hand = fixed("hand", "link5", 0.5).replace('mass value="0.5"', 'mass value="${tool}"')
    mass = "${table['masses']['link'] * $(optenv ARM_MASS 2)}"
    body = link("base") + arm(5).replace('mass value="5.0"', f'mass value="{mass}"')
    text = f"""<robot name="made" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="physical" default="$(find own_description)/config/physical.yaml"/>
<xacro:include filename="$(find own_description)/urdf/inc/common.xacro"/>
<xacro:read physical="$(arg physical)" tool="$(find other_description)/config/tool.yaml"/>
{body}{hand}</robot>"""
    robot = load_robot(f"{written(own / 'urdf', text, 'own.urdf.xacro')} far:=3")
    # The table's own number, and the default of what the environment may hold.
    assert robot.chain.mass[0] == pytest.approx(2.0)
    assert robot.chain.mass[-1] == pytest.approx(1.0 + 3.0 * 0.25)


def test_without_the_package_the_line_that_expands_it_is_reported(tmp_path, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "xacro", None)
    path = written(tmp_path, xacro(), "arm.urdf.xacro")
    line = r"pip install 'vftcli\[xacro\]'.*xacro arm\.urdf\.xacro name:=made > arm\.urdf$"
    with pytest.raises(RobotError, match=line):
        load_robot(f"{path} name:=made")


def test_what_only_names_the_language_is_a_urdf(tmp_path: Path) -> None:
    """Expanded files keep the declaration of its namespace."""
    text = robot(link("base"), arm(5)).replace("<robot", '<robot xmlns:xacro="http://xacro"', 1)
    assert load_robot(written(tmp_path, text)).joints == 5


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
        ("<a>" * 500 + "</a>" * 500, "its first element is <a>, not <robot> or <mujoco>"),
        ("", "which is XML: no element found"),
        ("<robot", "which is XML: unclosed token"),
        ("<robot>&undefined;</robot>", "which is XML: undefined entity"),
        ("<x:robot/>", "which is XML: unbound prefix"),
        ("<robot>\x00</robot>", "which is XML: "),
    ],
)
def test_a_hostile_text_is_refused(text: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(RobotError, match=words):
        load_robot(written(tmp_path, text))
