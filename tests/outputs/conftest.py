"""Analyses of simulated arms, one with hostile names in it, and a real browser for their pages."""

import shlex
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from contact_rows import contact, contact_list
from example_logs import CIRCLE
from made_runs import analyse_log

from vftcli.analysis import Analysis
from vftcli.evaluation import ReferenceChoice
from vftcli.evaluation.errors import evaluate
from vftcli.outputs.run_record import run_record
from vftcli.pipeline import AnalysisChoice, analyse, run_of
from vftcli.robots import RobotChoice, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording, Source
from vftcli.signals.remarks import caution, fact
from vftcli.wrench import WrenchChoice

HOSTILE = '<script>alert("x")</script>&_%.csv'


@pytest.fixture(scope="session")
def recording() -> Recording:
    """600 samples of a UR5 at 125 Hz on smooth paths, with noise of seed 3 and one gap of 0.4 s.

    The drives carry gravity, so that the doctor lets the log pass.
    """
    rng, samples = np.random.default_rng(3), 600
    t = 0.008 * np.arange(samples)
    t[400:] += 0.4
    rate = np.array([0.7, 0.9, 1.1, 1.3, 0.8, 1.2])
    q = 0.5 * np.sin(t[:, None] * rate) - np.array([0.0, 1.2, -1.0, 1.0, 1.5, 0.0])
    robot = load_robot("ur5")
    held = momentum_terms(robot.chain, q, np.zeros_like(q)).gravity / robot.torque_constant
    odd = caution("topic-too-short", signal="look & feel", topic="/odd")
    source = Source(
        path=Path(HOSTILE), format="table", sha256="ab" * 32, t0=100.25, rows=600,
        remarks=(fact("sign-turned", signal="<b>one</b>"), odd),
    )  # fmt: skip
    current = held + rng.normal(0.0, 1.0, (samples, 6))
    tau_ext = rng.normal(0.0, 2.0, (samples, 6))
    dq = 0.5 * rate * np.cos(t[:, None] * rate)
    return Recording(t=t, q=q, dq=dq, current=current, tau_ext=tau_ext, source=source)


@pytest.fixture(scope="session")
def without_reference(recording: Recording) -> Analysis:
    """All default observers on the log, with nothing to be judged by."""
    choice = AnalysisChoice(robot=RobotChoice(name="ur5"))
    return analyse(run_of(recording, load_robot("ur5"), choice), choice)


@pytest.fixture(scope="session")
def analysis(without_reference: Analysis) -> Analysis:
    """The same against a reference that has a floor and is unknown for its first 20 samples."""
    made = without_reference
    tau = np.array(made.recording.tau_ext)
    tau[:20] = np.nan
    reference = ExternalTorque(name="vendor", t=made.t, tau=tau, floor=np.full(6, 0.5))
    errors = evaluate(made.recording.name, made.estimates, reference)
    made = replace(made, reference=reference, errors=errors)
    return replace(made, run=run_record(made, shlex.join(["vftcli", "report", HOSTILE])))


@pytest.fixture(scope="session")
def touched(analysis: Analysis) -> Analysis:
    """The same with two contacts: on the wrist from 1 to 1.5 s, on link 3 from 2.2 to 2.6 s."""
    wrist = contact(number=1, start=1.0, stop=1.5, peak=1.2, where="wrist", places=(0, 5, 6))
    forearm = contact(number=2, start=2.2, stop=2.6, peak=2.4, where="forearm", places=(3,))
    return replace(analysis, contacts=contact_list(wrist, forearm))


@pytest.fixture(scope="session")
def with_wrench(recording: Recording) -> Analysis:
    """The log's estimates with their wrenches in base axes."""
    request = AnalysisChoice(wrench=WrenchChoice(frame="base"), robot=RobotChoice(name="ur5"))
    return analyse(run_of(recording, load_robot("ur5"), request), request)


@pytest.fixture(scope="session")
def as_if() -> Callable[..., Analysis]:
    """Makes an analysis look as if it were of another recording, or of another arm."""

    def as_if(analysis: Analysis, recording: Recording | None = None, arm: str = "") -> Analysis:
        log = analysis.motion.log
        robot = load_robot(arm) if arm else log.robot
        run = replace(log, recording=recording or log.recording, robot=robot)
        return replace(analysis, motion=replace(analysis.motion, log=run))

    return as_if


@pytest.fixture(scope="session")
def pushed() -> Analysis:
    """The simulated UR5 on a circle, pushed twelve times, judged by the two-cycle difference."""
    two_cycle = ReferenceChoice(name="two-cycle")
    return analyse_log(CIRCLE, AnalysisChoice(robot=RobotChoice(name="ur5"), reference=two_cycle))


BROWSERS = "chromium", "chromium-browser", "google-chrome"
"""Programs that a page is opened in, the first that is installed."""


class Tab:
    """A page opened in a browser; errors of its scripts, and all that it wrote to the console."""

    def __init__(self, page: Any, path: Path) -> None:
        self.page = page
        self.errors: list[str] = []
        page.on("console", lambda message: self.errors.append(message.text))
        page.on("pageerror", lambda error: self.errors.append(str(error)))
        page.goto(path.as_uri())

    def unfold(self) -> None:
        """Open every part of the details and wait until its charts have been drawn."""
        self.page.evaluate("document.querySelectorAll('details').forEach(x => { x.open = true })")
        self.page.wait_for_timeout(150)
        # A busy machine draws late.
        self.page.evaluate("new Promise((done) => requestIdleCallback(done, {timeout: 5000}))")

    def blank_charts(self) -> list[str]:
        """Charts, living or still, that take no room or on which nothing is drawn."""
        return self.page.evaluate("""() => {
          const drawn = (canvas) => canvas.width && canvas.height && canvas.getContext("2d")
            .getImageData(0, 0, canvas.width, canvas.height).data.some((value) => value);
          const living = [...document.querySelectorAll("canvas")].filter((x) => !drawn(x));
          const still = [...document.querySelectorAll("figure svg")].filter((svg) => {
            const { width, height } = svg.getBoundingClientRect();
            return !(width > 20 && height > 20 && svg.querySelector("path, rect"));
          });
          return [...living, ...still].map((x) => x.closest("figure").textContent);
        }""")

    def check(self) -> None:
        """Everything is drawn and fits, and no script failed."""
        self.unfold()
        assert (self.blank_charts(), self.errors) == ([], [])
        assert self.overflow <= 0

    @property
    def overflow(self) -> int:
        """By how many pixels the page is wider than its window."""
        return self.page.evaluate("document.documentElement.scrollWidth - innerWidth")


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """A real browser without a window; skips where there is none."""
    lacking = "no page is opened: the package playwright is not installed"
    playwright = pytest.importorskip("playwright.sync_api", reason=lacking)
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if program is None:
        pytest.skip(f"no page is opened: none of {', '.join(BROWSERS)} is installed")
    with playwright.sync_playwright() as running:
        # Within a container the browser's own sandbox cannot start.
        opened = running.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture
def opened(browser: Any, tmp_path: Path) -> Iterator[Callable[..., Tab]]:
    """Opens a page's text in the browser, in a window of its own kind."""
    contexts = []

    def opened(html: str, width: int = 1280, **kind: Any) -> Tab:
        path = tmp_path / f"{len(contexts)}.html"
        path.write_text(html, encoding="utf-8")
        contexts.append(browser.new_context(viewport={"width": width, "height": 900}, **kind))
        return Tab(contexts[-1].new_page(), path)

    yield opened
    for context in contexts:
        context.close()
