"""Copies of datasets with forces in them: right numbers, whole files, and a run that goes on."""

import importlib.util
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from vftcli.batch import WorkersChoice, annotation
from vftcli.batch.annotation import ForceChoice, annotate, gathered, joint_names
from vftcli.batch.cluster import Outcome
from vftcli.observers import ObserverChoice
from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import recognise
from vftcli.robots import RobotChoice
from vftcli.signals.errors import LogError, ParameterError
from vftcli.signals.progress import heard_by
from vftcli.wrench import WrenchChoice

FIXTURE = Path(__file__).parents[2] / "fixtures" / "panda_episodes"
FILES = [f"data/chunk-000/file-{k:03d}.parquet" for k in (0, 1)]
TORQUE = "observation.external_torque"
NO_DQ = "q=observation.state,tau=observation.effort"


def made(
    path: Path, copy: Path, asked: ForceChoice | None = None, workers: int = 0, **how: Any
) -> dict[str, Any]:
    here = WorkersChoice(jobs=workers)
    return annotate(path, copy, asked or ForceChoice(), here, "x", lambda _words: None, **how)


def observed_by(name: str) -> ForceChoice:
    """One observer, the Kalman filters' R and Q read as densities."""
    settings = {"kfo": {"noise_convention": "density"}}
    return ForceChoice(observers=ObserverChoice(names=(name,), settings=settings))


def torques(copy: Path) -> pl.DataFrame:
    return pl.concat([pl.read_parquet(path) for path in sorted(copy.glob("data/*/*.parquet"))])


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    shutil.copytree(FIXTURE, tmp_path / "set")
    return tmp_path / "set"


def edited(dataset: Path, column: str, edit: Any) -> None:
    path = dataset / FILES[0]
    table = pq.read_table(path)
    values = np.array(table.column(column).to_pylist(), np.float32)
    edit(values)
    lists = pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])
    pq.write_table(table.set_column(table.column_names.index(column), column, lists), path)


MISSING = {"status": "missing", "file": "a/t.h5", "episode": 0, "reason": "t.h5: no dq."}
DONE = {"status": "done", "file": "b/t.h5", "episode": 0, "joints": None, "joint_count": 2}


def test_an_episode_that_lacks_frames_is_refused_by_its_file() -> None:
    """All files of DROID have one name."""
    for reason, said in (
        ("t.h5: no dq.", r"^a/t.h5: no dq\. --any"),
        ("no dq", r"^no dq\. --any"),
    ):
        record = MISSING | {"reason": reason}
        outcome = Outcome(None, {"episodes": [record], "robot": None, "observer": None})
        with pytest.raises(LogError, match=said):
            gathered([outcome], ForceChoice())
        assert gathered([outcome], ForceChoice(anyway=True))["episodes"] == [record]


def test_episodes_are_gathered_in_the_order_of_their_files() -> None:
    arms = ({"name": "one"}, {"name": "two"})
    results = [
        {"episodes": [DONE | {"episode": 2}, DONE], "robot": None, "observer": "gmo"},
        {"episodes": [DONE | {"file": "a/t.h5"}], "robot": arms[0], "observer": "fdo"},
        {"episodes": [], "robot": arms[1], "observer": None},
    ]
    made = gathered([Outcome(None, result) for result in results], ForceChoice())
    found = [(one["file"], one["episode"]) for one in made["episodes"]]
    assert found == [("a/t.h5", 0), ("b/t.h5", 0), ("b/t.h5", 2)]
    assert (made["robot"], made["observer"]) == (arms[0], "gmo")


def test_joints_are_named_by_the_first_episode_that_is_done() -> None:
    named = DONE | {"joints": ["a", "b"]}
    assert joint_names({"episodes": [MISSING, DONE, named]}) == ["joint_1", "joint_2"]
    assert joint_names({"episodes": [MISSING, named, DONE]}) == ["a", "b"]
    for episodes, said in (
        ([], "the dataset has no episodes"),
        ([MISSING, MISSING | {"reason": "why"}], "none of the 2 .* the first: t.h5: no dq"),
        ([DONE, DONE | {"joint_count": 7}], "arms of 2 and 7 joints"),
    ):
        with pytest.raises(LogError, match=said):
            joint_names({"episodes": episodes})


def test_the_whole_copy(tmp_path: Path) -> None:
    asked = ForceChoice(wrench=WrenchChoice(frame="base"), sd=True)
    heard: list[tuple[str, float]] = []
    with heard_by(lambda *step: heard.append(step)):
        record = made(FIXTURE, tmp_path / "copy", asked)
    begins = [begin for _, begin in heard]
    assert list(dict.fromkeys(begins)) == [0.0, 0.8, 0.9]
    assert [words for words, begin in heard if begin == 0.0] == [
        f"{count} episodes estimated" for count in (2, 3)
    ]
    assert all(words for words, _ in heard)  # an episode's own steps are not heard
    copy, own = tmp_path / "copy", Path("meta", "vftcli.json")
    there = {path.relative_to(copy) for path in copy.rglob("*.*")}
    assert there == {own, *(path.relative_to(FIXTURE) for path in FIXTURE.rglob("*.*"))}
    assert json.loads((copy / own).read_text()) == json.loads(json.dumps(record))
    assert (record["status"], record["causal"]) == ({"done": 3}, True)
    assert (record["robot"]["name"], record["observer"]["name"]) == ("panda", "kfo-zoh")
    assert set(record["sources"]) == set(FILES)
    assert [e["frames"] for e in record["episodes"]] == [200, 160, 180]
    # kfo-zoh's slowest pole at 25 Hz: .24 a frame; 1 % is left after some four
    assert {e["transient_frames"] for e in record["episodes"]} == {4}
    table = torques(copy)
    assert len(table) == 540
    assert not any(table[name].explode().is_nan().any() for name in table.columns[-3:])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:Port")  # of Dask's own page, where another cluster has it
def test_the_bytes_are_those_of_two_workers(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    made(FIXTURE, tmp_path / "here")
    made(FIXTURE, tmp_path / "there", workers=2)
    for path in (tmp_path / "here").rglob("*.*"):
        other = tmp_path / "there" / path.relative_to(tmp_path / "here")
        assert path.read_bytes() == other.read_bytes()


def test_a_run_goes_on_where_it_was_cut_off(tmp_path: Path, monkeypatch) -> None:
    done: list[int] = []
    analysed, write = annotation.estimate_episodes, annotation.write_file

    def counted(choice: Any, task: Any) -> Any:
        if not task.rows.is_file():
            done.extend(task.file.episodes)
        return analysed(choice, task)

    def cut(*_: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(annotation, "estimate_episodes", counted)
    monkeypatch.setattr(annotation, "write_file", cut)
    copy = tmp_path / "copy"
    with pytest.raises(KeyboardInterrupt):
        made(FIXTURE, copy)
    assert not copy.exists()
    assert copy.with_name(f"{copy.name}.partial").is_dir()
    monkeypatch.setattr(annotation, "write_file", write)
    made(FIXTURE, copy)
    assert done == [0, 1, 2]
    assert [path.name for path in tmp_path.iterdir()] == ["copy"]
    made(FIXTURE, tmp_path / "unbroken")
    for name in (*FILES, "meta/info.json", "meta/stats.json", "meta/vftcli.json"):
        assert (copy / name).read_bytes() == (tmp_path / "unbroken" / name).read_bytes()


def test_a_link_out_of_a_dataset_is_refused_before_anything_is_computed(
    dataset: Path, tmp_path: Path
) -> None:
    (dataset / "meta" / "leak.txt").symlink_to("/etc/hostname")
    with pytest.raises(LogError, match=r"leak\.txt is a link to /etc/hostname"):
        made(dataset, tmp_path / "copy")
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


def test_frames_without_a_number_stop_it_or_are_marked(dataset: Path, tmp_path: Path) -> None:
    def spoil(values: np.ndarray) -> None:
        values[[50, 51], 3] = np.nan  # of episode 0
        values[200:, 1] = np.nan  # all of episode 1

    edited(dataset, "observation.velocity", spoil)
    with pytest.raises(LogError, match="external_torque is missing in 2 of 200 frames") as error:
        made(dataset, tmp_path / "copy")
    assert "\n" not in str(error.value)
    record = made(dataset, tmp_path / "copy", ForceChoice(anyway=True))
    assert record["status"] == {"part": 1, "missing": 1, "done": 1}
    assert record["episodes"][0]["missing_frames"] == {"external_torque": 2}
    # a joint without any velocity is left out, and the arm has none without it
    assert "the joints of the log" in record["episodes"][1]["reason"]
    table = torques(tmp_path / "copy")
    valid = table["observation.external_torque_valid"].to_numpy()
    zero = [*range(50, 52), *range(200, 360)]
    assert np.flatnonzero(valid == 0).tolist() == zero
    assert np.all(np.array(table[TORQUE].to_list())[zero] == 0.0)


def test_poses_that_hide_the_wrench_stop_it(dataset: Path, tmp_path: Path) -> None:
    def hold(value: float) -> Any:
        def edit(values: np.ndarray) -> None:
            values[:200, 3] = value

        return edit

    edited(dataset, "observation.state", hold(-0.5))  # J4 of episode 0: σ_min .004 m
    edited(dataset, "observation.velocity", hold(0.0))
    by_map = ForceChoice(wrench=WrenchChoice(solver="map"))
    with pytest.raises(LogError, match=r"virtual-sensor\.solver=smoother has a wrench in every"):
        made(dataset, tmp_path / "copy", by_map)


TURNED = "q=observation.state,dq=observation.velocity,-tau=observation.effort"
NO_EFFORT = "q=observation.state,dq=observation.velocity"


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"robot": RobotChoice(name="ur5")}, "are not named as those of robot 'ur5'"),
        ({"read": ReadChoice(columns=TURNED)}, "effort"),
        ({"read": ReadChoice(columns=NO_DQ)}, r"no joint velocities\. --set log.derive=dq"),
        ({"read": ReadChoice(columns=NO_EFFORT)}, "no joint torques or currents"),
        (
            {"observers": ObserverChoice(names=("gmo",)), "sd": True},
            "states no standard deviation",
        ),
    ],
)
def test_what_tells_no_forces_is_refused_and_leaves_nothing(tmp_path: Path, asked, said) -> None:
    with pytest.raises((LogError, ParameterError), match=said):
        made(FIXTURE, tmp_path / "copy", ForceChoice(**asked))
    assert not any(tmp_path.iterdir())


def test_efforts_that_are_zero_are_refused(dataset: Path, tmp_path: Path) -> None:
    def zero(values: np.ndarray) -> None:
        values[:, :4] = 0.0

    edited(dataset, "observation.effort", zero)
    with pytest.raises(LogError, match="the effort of J1, J2, J3, J4 is 0 in every frame"):
        made(dataset, tmp_path / "copy")
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


def test_derived_velocities_and_smoothers_are_recorded_as_not_causal(tmp_path: Path) -> None:
    derived = ForceChoice(read=ReadChoice(columns=NO_DQ, derive="dq"))
    assert not made(FIXTURE, tmp_path / "derived", derived)["causal"]
    assert not made(FIXTURE, tmp_path / "smooth", observed_by("kfo-rts"))["causal"]
    info = json.loads((tmp_path / "smooth" / "meta" / "info.json").read_text())
    assert info["features"][TORQUE]["info"]["causal"] is False


@pytest.mark.slow
@pytest.mark.parametrize(
    ("observer", "sample"),
    [
        ("kfo-zoh", "lerobot_v3_effort"),
        ("gmo", "lerobot_v3_effort"),
        ("kfo-zoh", "lerobot_v21_effort"),
    ],
)
def test_a_dataset_has_the_expected_torques(
    observer: str, sample: str, samples: Path, tmp_path: Path
) -> None:
    """Its expected ones start at zero: from frame 20 on nothing is left of that, and float32 of
    13 N·m leaves 1e-6; the specification asks for 1e-5."""
    made(samples / sample, tmp_path / "copy", observed_by(observer))
    expected = pl.read_parquet(samples / "lerobot_v3_effort.expected.parquet")
    table = torques(tmp_path / "copy").join(expected, ["episode_index", "frame_index"])
    found = np.array(table[TORQUE].to_list())
    named = table.select(f"tau_ext/{observer}/{j}" for j in range(1, 8)).to_numpy()
    late = (table["frame_index"] >= 20).to_numpy()
    assert len(table) == (1950 if "v3" in sample else 1300)
    assert np.abs(found - named)[late].max() < 1e-5


SPECIFIED = {
    "gmo": [
        [0.218, 0.459, 0.216, 0.688, 0.151, 0.17 / 1.1, 0.094],
        [0.229, 0.450, 0.229, 0.497, 0.127, 0.17 / 1.1, 0.062],
    ],
    "kfo-rts": [
        [0.193, 0.336, 0.172, 0.610, 0.108, 0.139, 0.085],
        [0.205, 0.336, 0.193, 0.387, 0.115, 0.127, 0.052],
    ],
}
"""Errors that are allowed, 1.1 times these: friction that the model knows to 10 %. [N·m]"""


@pytest.mark.parametrize("observer", SPECIFIED)
def test_droid_s_episodes_have_the_errors_of_the_model(
    observer: str, samples: Path, tmp_path: Path
) -> None:
    h5py = pytest.importorskip("h5py")
    copy = tmp_path / "copy"
    made(samples / "droid_raw", copy, observed_by(observer))
    for k, path in enumerate(sorted(copy.rglob("trajectory.h5"))):
        with h5py.File(path) as content:
            found = content["observation/robot_state/external_torque"][()]
        truth = pl.read_parquet(samples / f"droid_raw_{k}.truth.parquet")
        true = truth.select(f"tau_ext/{j}" for j in range(1, 8)).to_numpy()
        error = np.sqrt(np.mean((found - true) ** 2, axis=0))
        assert np.all(error < 1.1 * np.array(SPECIFIED[observer][k]))
    # the folder meta beside the episodes makes it no LeRobot dataset
    assert recognise(copy).name == "droid"
    original = next((samples / "droid_raw").rglob("trajectory.h5"))
    assert original.stat().st_nlink == 1


@pytest.mark.skipif(
    importlib.util.find_spec("datasets") is None,
    reason="the datasets library is not installed: pip install 'vftcli[datasets-test]'",
)
def test_the_datasets_library_loads_it_by_its_own_description(
    tmp_path: Path, monkeypatch
) -> None:
    """As LeRobot does: Features built from info.json; a column missing in either is an error."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    import datasets

    asked = ForceChoice(wrench=WrenchChoice(), sd=True, anyway=True)
    made(FIXTURE, tmp_path / "copy", asked)
    info = json.loads((tmp_path / "copy" / "meta" / "info.json").read_text())
    features = {}
    for name, reported in info["features"].items():
        value = datasets.Value(reported["dtype"])
        width = reported["shape"][0]
        features[name] = value if width == 1 else datasets.Sequence(value, length=width)
    datasets.disable_progress_bars()
    loaded = datasets.load_dataset(
        "parquet",
        data_dir=str(tmp_path / "copy" / "data"),
        features=datasets.Features(features),
        split="train",
        cache_dir=str(tmp_path / "cache"),
    )
    assert len(loaded) == 540
    table = torques(tmp_path / "copy")
    assert loaded[300][TORQUE] == table[TORQUE][300].to_list()
