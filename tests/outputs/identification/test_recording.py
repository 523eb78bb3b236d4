import numpy as np
import rerun.chunk

from vftcli.outputs.identification.recording import (
    summary,
    tabs_of,
    write_identification_rrd,
)


def test_every_log_has_two_tabs(found, tmp_path):
    result, _ = found
    torque, residual = tabs_of(result.traces[0], "b_.csv")
    assert torque.name.endswith("(train)")
    assert residual.name == f"{torque.name}: residual"
    assert torque.plots[2].path == "/torque/b_.csv/J3"
    both = torque.plots[2].values
    np.testing.assert_array_equal(both[:, 0], result.traces[0].measured[:, 2])
    np.testing.assert_allclose(
        residual.plots[2].values[:, 0], both[:, 0] - both[:, 1], atol=1e-12
    )  # rounding
    write_identification_rrd(tmp_path / "r.rrd", result)
    stream = rerun.chunk.RrdReader(str(tmp_path / "r.rrd")).stream()
    entities = {chunk.entity_path for chunk in stream}
    # b>.csv, in two roles: an entity's path may hold no such mark
    for name in ("b_.csv", "b_.csv-2"):
        assert {f"/residual/{name}/J{j}" for j in range(1, 7)} <= entities
    assert "/summary" in entities


def test_the_summary_tells_logs_apart_by_their_digest(found):
    result, _ = found
    text = summary(result)
    assert "0" * 64 in text
    assert r"b\>.csv" in text
    assert text.count("mean RMS") == len(result.traces)
