import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vftcli.admittance.closed_loop import Replayed
from vftcli.admittance.replay import Replay
from vftcli.outputs.admittance import FILES, admittance_record, motion_table, write_admittance
from vftcli.outputs.run_record import to_json
from vftcli.signals.errors import OutputError


def test_a_replay_becomes_a_folder(release: Replay, tmp_path: Path) -> None:
    write_admittance(tmp_path / "out", Replayed(release), "vftcli admit")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted(FILES)
    record = json.loads((tmp_path / "out/run.json").read_text(encoding="utf-8"))
    assert record["command"] == "vftcli admit"
    assert record["input"] is None
    assert len(record["controllers"]) == len(release.controllers)
    with pytest.raises(OutputError, match="--force"):
        write_admittance(tmp_path / "out", Replayed(release))


def test_the_source_of_the_force_is_recorded_as_data(push: Replay) -> None:
    record = json.loads(to_json(admittance_record(Replayed(push), "")))
    assert record["force"]["code"] == "force-of-sensor"
    assert record["force"]["values"] == {"frame": "a push"}
    assert len(record["remarks"]) == len(push.remarks) > 0


def test_the_motion_holds_every_controller_and_what_entered(push: Replay) -> None:
    table = motion_table(push)
    assert len(table) == len(push.motion.t)
    label = push.controllers[1].name.replace(" ", "").replace("/", "-")
    np.testing.assert_array_equal(table[f"x/{label}/y"].to_numpy(), push.motion.x[:, 1, 1])
    np.testing.assert_array_equal(table[f"q/{label}/6"].to_numpy(), push.path.q[:, 1, 5])
    assert table["force/fy"][:-1].to_list() == push.wrench[:, 1].tolist()
    assert table["force/fy"][-1] is None  # the last deviation follows from the force before it
    assert table.schema["reached/" + label] == pl.Float64
