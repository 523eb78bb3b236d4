"""Options kept in a file do what the same options typed do, are said, and are checked alike."""

import json
import os
from pathlib import Path

import pytest

from vftcli.cli import config
from vftcli.signals.option import settings_by_name

LOG = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
KEPT = """
robot = "ur5"
observer = ["fdo", "gmo"]
interval = "0:4"
reference = "file:truth.csv"
[compare]
reference = "zero"
wrench = false
"""


def keep(folder: Path, text: str, name: str = config.NAME) -> Path:
    (folder / name).write_text(text, "utf-8")
    return folder / name


def test_kept_options_give_the_numbers_of_typed_ones(run, here: Path) -> None:
    typed = ("--robot", "ur5", "--observer", "fdo", "--observer", "gmo", "--interval", "0:4")
    _, expected, _ = run("compare", LOG, *typed, "--reference", "zero", "--json")
    keep(here, KEPT)
    code, out, err = run("compare", LOG, "--json", "--quiet")
    assert code == 0
    assert json.loads(out)["rows"] == json.loads(expected)["rows"]
    # Said even where little else is: a file nobody thinks of changes the results.
    assert err.splitlines()[0].startswith("note: vftcli.toml gives ")
    for option in ("--robot ur5", "--observer fdo --observer gmo", "--reference zero"):
        assert option in err


def test_what_is_typed_goes_before_what_is_kept(run, here: Path) -> None:
    keep(here, KEPT)
    _, out, err = run("compare", LOG, "--observer", "gmo", "--json")
    assert {row["observer"] for row in json.loads(out)["rows"]} == {"gmo"}
    assert "--observer" not in err
    code, _, err = run("compare", LOG, "--config", "none")
    assert (code, "note: " in err) == (2, False)
    assert "Missing option '--reference'" in err


def test_a_named_file_is_read_in_place_of_the_folder_s(run, here: Path) -> None:
    keep(here, "no TOML")
    keep(here, 'robot = "ur5"', "other.toml")
    code, _, err = run("inspect", LOG, "--config", "other.toml")
    said = "note: other.toml gives --robot ur5 (--config none: without it)"
    assert (code, err.splitlines()[0]) == (0, said)


def test_the_command_line_of_run_json_needs_no_file(run, here: Path) -> None:
    keep(here, 'robot = "ur5"\nobserver = ["gmo"]\nwrench = false\n[contacts]\nlist = false\n')
    assert run("estimate", LOG, "-o", "out")[0] == 0
    command = json.loads((here / "out/run.json").read_text("utf-8"))["command"]
    kept = "--observer gmo --robot ur5 --set contacts.list=no --config none"
    assert sorted(command.split()) == sorted(f"vftcli estimate {LOG} -o out {kept}".split())
    (here / config.NAME).unlink()
    assert run(*command.split()[1:], "-o", "again")[0] == 0
    files = [here / folder / "estimates.parquet" for folder in ("out", "again")]
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.slow
def test_kept_columns_are_not_those_of_estimates(run, here: Path) -> None:
    kept = 'robot = "ur5"\ncolumns = "-t,q:6"\nobserver = ["gmo"]\n[contacts]\nlist = false\n'
    keep(here, kept)
    code, _, err = run("estimate", LOG, "-o", "out")
    assert (code, "--columns=-t,q:6" in err) == (1, True)
    assert run("estimate", LOG, "-o", "out", "--config", "none", "--robot", "ur5")[0] == 0
    code, _, err = run("contacts", here / "out/estimates.parquet")
    assert (code, "--columns" in err) == (0, False)


def test_logs_behind_two_dashes_stay_behind_them(run, here: Path) -> None:
    keep(here, 'robot = "ur5"\n')
    (here / "-log.csv").symlink_to(LOG)
    code, out, err = run("inspect", "--json", "--", "-log.csv")
    assert (code, "note: vftcli.toml gives --robot ur5" in err) == (0, True)
    command = "vftcli inspect --json --robot ur5 --config none -- -log.csv"
    assert json.loads(out)["command"] == command


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('robt = "ur5"', "is no option of a command that reads a log. Did you mean robot?"),
        ("dance = 1", "A key is an option without its dashes, as robot."),
        ('[compare]\nrobt = "ur5"', "'robt' is no option of compare. Did you mean robot?"),
        ("[compre]\nwrench = true", "compre.wrench is no setting here; vftcli help settings"),
        ("force = true", "force is not kept in a file; type --force"),
        ("robot = ", "not valid TOML"),
        ("robot = true", "robot = True is not a text or a number"),
        ('robot = ["ur5", "ur3"]', "is not a text or a number"),
        ("robot = {name = 'ur5'}", "robot.name is no setting"),
        ("[two-cycle]\nperiot = 4", "here; vftcli help settings lists all. Did you mean"),
        ("free = [[1, 2]]", "is not a text, a number or a list of them"),
        ('wrench = "yes"', "wrench = 'yes' is neither true nor false"),
        ('[two-cycle]\nperiod = "long"', "two-cycle.period=long is not a number"),
        ('[two-cycle]\nalignment = "odd"', "no alignment 'odd'"),
        ("two-cycle = 4", "'two-cycle' is no option of a command that reads a log"),
        ('robot = "mine.toml"', f"{Path('sub/mine.toml')}: no such robot file"),
    ],
)
def test_what_is_wrong_with_a_file_is_said_in_one_line(refused, here, text, said) -> None:
    (here / "sub").mkdir()
    file = keep(here / "sub", text, "kept.toml").relative_to(here)
    assert said in refused("report", LOG, "-o", "out", "--config", file)
    assert not (here / "out").exists()


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("name", ["nowhere.toml", ".", os.devnull, str(LOG)])
def test_what_is_no_such_file_is_refused(refused, name: str) -> None:
    assert f"{name}: " in refused("inspect", LOG, "--config", name)


@pytest.mark.parametrize("content", [b"robot = '\xff'", "robot = 'ur5'".encode("utf-16")])
def test_a_file_in_another_encoding_is_refused_in_words(run, refused, here, content) -> None:
    (here / config.NAME).write_bytes(content)
    error = refused("inspect", LOG)
    assert error.endswith("cannot be read as a file of options (not a text in UTF-8)")
    # Help needs no such file.
    assert run("inspect", "--help")[0] == 0
    assert run("help", "robots")[0] == 0


def test_files_are_named_from_the_folder_of_the_file(run, here: Path) -> None:
    (here / "sub").mkdir()
    (here / "sub/free.csv").write_bytes(LOG.read_bytes())
    keep(here / "sub", 'robot = "ur5"\nfree = ["free.csv", "0.3:4"]\n')
    kept = ("--config", Path("sub") / config.NAME)
    code, _, err = run("contacts", LOG, *kept)
    assert f"--free {Path('sub/free.csv')} --free 0.3:4" in err
    assert (code, "are the same run" in err) == (1, True)
    # A log is no free run of itself.
    code, _, err = run("contacts", Path("sub/free.csv"), *kept)
    assert (code, "gives --robot ur5 --free 0.3:4 (" in err) == (0, True)


def test_switches_and_numbers_are_kept_as_they_are_typed(run, here: Path) -> None:
    """Of one log too, whose own name alone is left out of what is free."""
    keep(here, 'robot = "ur5"\nanyway = true\ndetails = true\n[contacts]\nall = true\n')
    _, _, err = run("contacts", LOG, "--interval", "0:2")
    gives = err.splitlines()[0]
    for word in ("--robot ur5", "--anyway", "--details", "--all"):
        assert word in gives


def test_an_option_that_a_command_takes_otherwise_is_its_own_table_s(run, here: Path) -> None:
    """`identify --free` is the motion without a load; `thresholds --reference` is of --check."""
    keep(here, 'robot = "ur5"\nreference = "two-cycle"\n')
    _, _, err = run("thresholds", LOG, "--interval", "0:1")
    assert err.startswith("note: vftcli.toml gives --robot ur5 (")
    assert "--check" not in err
    keep(here, 'robot = "ur5"\n[thresholds]\nreference = "two-cycle"\n')
    assert "--check" in run("thresholds", LOG)[2]


def test_the_file_is_an_input_that_nothing_writes_over(refused, here: Path) -> None:
    kept = keep(here, 'robot = "ur5"\n')
    error = refused("identify", LOG, "--method", "gains", "-o", kept, "--force")
    assert "what this command reads" in error
    assert kept.read_text("utf-8") == 'robot = "ur5"\n'


def test_every_option_kept_otherwise_exists() -> None:
    every = config.every_command()
    settings = settings_by_name(config.choices_of(*every.values()))
    for command, keys in config.OTHERWISE.items():
        assert keys <= {*config.options_of(every[command]), *settings}


def test_settings_of_a_group_that_is_called_as_a_command_stand_in_its_table(run, here) -> None:
    of_identify = '[identify]\ncutoff = 5\nmethod = "guess"\n'
    keep(here, f'robot = "ur5"\n{of_identify}[two-cycle]\nperiod = 4\n')
    code, _, err = run("identify", LOG)
    assert (code, "there is friction, base" in err) == (1, True)
    for word in ("--set identify.cutoff=5", "--set two-cycle.period=4", "--method guess"):
        assert word in err
    assert "--method" not in run("compare", LOG, "--reference", "zero", "--interval", "0:1")[2]


def test_a_typed_setting_goes_before_a_kept_one(run, here: Path) -> None:
    keep(here, 'robot = "ur5"\n[gmo]\ngain = [5, 5, 5, 5, 5, 5]\n[fdo]\nomega = 8\n')
    words = ("--observer", "gmo", "--observer", "fdo", "--reference", "zero", "--json")
    _, kept, err = run("compare", LOG, *words, "--set", "gmo.gain=9")
    assert "gives --set fdo.omega=8 --robot ur5 (" in err
    typed = ("--set", "gmo.gain=9", "--set", "fdo.omega=8", "--robot", "ur5", "--config", "none")
    assert kept == run("compare", LOG, *words, *typed)[1]
