"""For all tests: the folders of real logs, or a skip that says why, and each test's processor time.

`--cpu-limit` fails a test that takes longer and is not marked slow; `--cpu-record` keeps the times.
"""

import contextlib
import importlib
import os
import subprocess
import sys
from collections.abc import Callable, Generator
from pathlib import Path

import pytest
from hypothesis import settings

# How long an example takes tells how busy the machine is, not whether the code is right.
settings.register_profile("steady", deadline=None)
settings.load_profile("steady")

BEGUN, SHARED = pytest.StashKey[float](), pytest.StashKey[float]()

DEAR = frozenset({"pushed", "worked_up", "logs_of_one_motion"})
"""Fixtures of the session that may take longer: whole reports, three simulated logs (.8 s)."""

LOADED_LATE = ("scipy.signal", "polars", "pinocchio", "rerun", "distributed", "matplotlib.figure")
"""What vftcli imports late, .3 to 1.6 s each: charged to no test, whatever the order."""


def cpu_time() -> float:
    """Processor time of this process, its threads and its ended children [s], to 10 ms."""
    return sum(os.times()[:4])


def pytest_addoption(parser: pytest.Parser) -> None:
    limit = "fail a test that is not marked slow and uses more processor time, its setup included"
    keep = "append `test<TAB>seconds of processor time`; a worker of xdist to FILE.WORKER"
    parser.addoption("--cpu-limit", type=float, metavar="SECONDS", help=limit)
    parser.addoption("--cpu-record", type=Path, metavar="FILE", help=keep)


def pytest_configure(config: pytest.Config) -> None:
    """Make the times those of the tests alone; their file is found from any folder."""
    config.stash[SHARED] = 0.0
    config.pluginmanager.register(SharedTime())
    file = config.getoption("--cpu-record")
    if file:
        worker = os.environ.get("PYTEST_XDIST_WORKER")
        config.option.cpu_record = Path(f"{file}.{worker}" if worker else file).absolute()
    if file or config.getoption("--cpu-limit") is not None:
        for name in LOADED_LATE:
            with contextlib.suppress(ImportError):
                importlib.import_module(name)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, object, object]:
    """Start a test's clock before its fixtures: what a module shares is charged to its first."""
    item.stash[BEGUN] = cpu_time() - item.config.stash[SHARED]
    return (yield)


class SharedTime:
    """Charges what the session shares to no test: which needs it first depends on the worker.

    What takes longer than the limit has to be one of `DEAR`, as a slow test has to be marked. A
    plugin, because fixtures of the session ask no conftest below the root.
    """

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(
        self, fixturedef: pytest.FixtureDef[object], request: pytest.FixtureRequest
    ) -> Generator[None, object, object]:
        begun = cpu_time()
        result = yield
        if fixturedef.scope == "session":
            spent, name = cpu_time() - begun, fixturedef.argname
            request.config.stash[SHARED] += spent
            record(request.config, f"fixture {name}", spent)
            limit = request.config.getoption("--cpu-limit")
            if limit is not None and spent > limit and name not in DEAR:
                pytest.fail(f"fixture {name}: {spent:.1f} s, over {limit:g} s: name it in DEAR")
        return result


def record(config: pytest.Config, name: str, spent: float) -> None:
    """Append a processor time [s] to the file that is asked for."""
    if file := config.getoption("--cpu-record"):
        with file.open("a", encoding="utf-8") as times:
            times.write(f"{name}\t{spent:.2f}\n")


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_call(item: pytest.Item) -> Generator[None, object, object]:
    result = yield
    spent = cpu_time() - item.config.stash[SHARED] - item.stash[BEGUN]
    record(item.config, item.nodeid, spent)
    limit = item.config.getoption("--cpu-limit")
    if limit is not None and spent > limit and not item.get_closest_marker("slow"):
        pytest.fail(f"{spent:.1f} s of processor time, over {limit:g} s: mark it slow")
    return result


@pytest.fixture(scope="session")
def logs() -> Path:
    """The folder of real logs that VFT_LOGS names."""
    folder = os.environ.get("VFT_LOGS", "")
    if not folder:
        pytest.skip("VFT_LOGS is not set: the real logs are not part of the repository")
    return Path(folder)


@pytest.fixture(scope="session")
def samples(logs: Path) -> Path:
    """The folder of sample files, beside the real logs."""
    folder = logs.parent / "samples"
    if not folder.is_dir():
        pytest.skip("the folder of samples is not beside VFT_LOGS")
    return folder


@pytest.fixture(scope="session")
def loaded() -> Callable[[str], set[str]]:
    """What Python has loaded once some modules, as "a, b", are imported in a process of its own."""

    def after(modules: str) -> set[str]:
        script = f"import sys, {modules}\nprint(*sys.modules)"
        return set(subprocess.check_output([sys.executable, "-c", script], text=True).split())

    return after
