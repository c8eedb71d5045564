"""Recordings of another engine: moved as by `replay`, written as they moved, set beside truth."""

import numpy as np
import pytest

from benchmarks import identification_engines as engines
from benchmarks.engines import ours
from softgym_mj.reality import primitives, rags
from softgym_mj.reality.identification import rag_data, synthetic
from softgym_mj.reality.meshes import rectangle
from softgym_mj.reality.rag_scene import TABLE, corners, hung
from softgym_mj.reality.replay import Hold, replay


def test_an_engine_moves_a_rag_over_the_table_as_replays_do():
    """Of ours, which replays have, too."""
    mesh = rectangle(*rag_data.SIZE, 0.08)
    start, times = hung(mesh), np.arange(0.0, 0.5, 0.1)
    hold = Hold(corners(mesh), lambda when: primitives.gripper_positions("dynamic", when))
    where = {"start": start, "begin": -0.2, "floor": TABLE, "step": 0.01}
    found = engines.moved_by(ours.engine(), mesh, engines.FABRIC, hold, times, **where)
    expected = replay(mesh, engines.FABRIC, [hold], times, **where).positions
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_recordings_are_of_what_moves_the_rag(tmp_path, monkeypatch):
    """Here it goes up by 1 m/s as it is."""
    monkeypatch.setattr(rags, "FRAMES", {"dynamic": 4})

    def rising(mesh, fabric, hold, times, *, start, **where):
        return start + times[:, None, None] * [0.0, 0.0, 1.0]

    sensor = synthetic.Sensor(latency=0.0, noise=0.0)
    synthetic.write_rags(
        tmp_path, "linen", engines.FABRIC, sensor, 0.08, repeats=(0,), simulate=rising
    )
    clouds = rags.read_sequence(tmp_path, "linen", 0, "dynamic", 4)
    top = hung(rectangle(*rag_data.SIZE, 0.08))[:, 2].max()
    for number, cloud in enumerate(clouds):
        assert cloud.points[:, 2].max() == pytest.approx(top + number / rags.FRAME_RATE, abs=0.01)


def test_bias_is_relative_to_what_is_not_zero():
    truth = engines.true_values(engines.FABRIC)
    assert truth["drag"] == pytest.approx(7.0)
    assert truth["added_mass"] == 0.0
    found = {name: {"value": 1.1 * true} for name, true in truth.items()}
    found["added_mass"]["value"] = 0.3
    off = engines.bias(truth, found)
    assert off.pop("latency") == pytest.approx(0.1 * engines.SENSOR.latency)
    assert off.pop("added_mass") is None
    assert list(off.values()) == pytest.approx([0.1] * 5)


@pytest.mark.long
def test_drag_of_stock_air_is_in_proportion_to_its_density(monkeypatch):
    monkeypatch.setattr(engines, "FINE", 0.08)
    thin, dense = (engines.drag(engines.engine(rho), engines.FABRIC) for rho in (2.0, 6.0))
    assert dense == pytest.approx(3.0 * thin, rel=0.02)
