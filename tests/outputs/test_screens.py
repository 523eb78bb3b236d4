"""screens.md and docs/story.md show what the terminal shows."""

import re
import shlex
from collections.abc import Iterator

import pytest
from screens import OF_STORY, REAL, ROOT, printed, shown
from typer.testing import CliRunner

from vftcli.cli import make_app

app = make_app()

NUMBER = re.compile(r"[−-]?\d+(?:\.\d+)?")


def words(text: str) -> Iterator[str]:
    """The words of a screen without its bars, wherever its lines break."""
    for line in text.splitlines():
        yield from line.partition("┤")[0].split()


@pytest.mark.slow
@pytest.mark.parametrize("command", printed())
def test_a_screen_is_as_shown(command: str, request: pytest.FixtureRequest, tmp_path) -> None:
    real = REAL.keys() & set(command.split())
    logs = request.getfixturevalue("logs") if real else None
    agree(list(words(shown(command, logs, tmp_path))), list(words(printed()[command])))


def agree(ours: list[str], theirs: list[str]) -> None:
    """Equal words; another platform's last digit may turn a rounded number by one."""
    assert [NUMBER.sub("0", word) for word in ours] == [NUMBER.sub("0", word) for word in theirs]
    for mine, said in zip(ours, theirs, strict=True):
        pairs = zip(NUMBER.findall(mine), NUMBER.findall(said), strict=True)
        for a, b in ((float(x.replace("−", "-")), float(y.replace("−", "-"))) for x, y in pairs):
            assert abs(a - b) <= max(1.0, 0.05 * abs(b)), (mine, said)


STORY = ROOT / "docs" / "story.md"


@pytest.mark.slow
def test_the_story_quotes_what_its_commands_print(logs, tmp_path, monkeypatch):
    """Every command runs in one folder; what is quoted of it stands there, pieces in order."""
    for name, place in OF_STORY.items():
        (tmp_path / name).symlink_to(logs / place)
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"(?ms)^```console\n(.*?)^```$", STORY.read_text("utf-8"))
    assert len(blocks) >= 6
    text = re.sub(r" \\\n {4}", " ", "".join(blocks))
    for command, quoted in re.findall(r"(?ms)^\$ vftcli (.*?)\n(.*?)(?=^\$ |\Z)", text):
        result = CliRunner(env={"COLUMNS": "80"}).invoke(app, shlex.split(command))
        assert result.exit_code == 0, result.output
        rest = list(words(result.stdout))
        for piece in (list(words(part)) for part in quoted.split("…\n")):
            plain = [NUMBER.sub("0", word) for word in rest]
            sought = [NUMBER.sub("0", word) for word in piece]
            starts = range(len(rest) - len(piece) + 1)
            at = next((n for n in starts if plain[n : n + len(piece)] == sought), None)
            assert at is not None, (command, piece)
            agree(rest[at : at + len(piece)], piece)
            rest = rest[at + len(piece) :]
