"""The logs of `fixtures/`, as tests of all rooms name them."""

from pathlib import Path

FIXTURES = Path(__file__).parents[1] / "fixtures"
CIRCLE, TAPS = FIXTURES / "ur5_circle.csv", FIXTURES / "ur5_taps_ur_rtde.csv"
BEARING, EPISODES = FIXTURES / "panda_bearing.csv", FIXTURES / "panda_episodes"
