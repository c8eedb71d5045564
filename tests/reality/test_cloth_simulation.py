"""The simulated cloth: on its tool, and properties found in its own recordings."""

import dataclasses
import json

import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.reality.cloth import identification
from softgym_mj.reality.cloth.recordings import Recording
from softgym_mj.reality.cloth.scenario import scenario_of
from softgym_mj.reality.cloth.simulation import ASSUMED, ClothSolver, Properties
from softgym_mj.reality.fitting import Unknown, fit, read_identified
from tests.command import output_of
from tests.reality import cloths


def simulated(name: str, properties: Properties, width: float, frames: int = 25) -> Recording:
    """Returns a recording of a cloth that this package simulates."""
    rigid = cloths.rigid(name, width, frames)
    scenario, _ = scenario_of(rigid, cloths.GRIP)
    every = dataclasses.replace(scenario, times=0.1 * np.arange(frames))
    nodes = ClothSolver("own", cloths.GRIP, properties).predict(every)
    return cloths.recording(name, width, every.times, nodes)


def test_the_held_edge_is_on_the_tool_and_the_cloth_hangs_below_it():
    own = simulated("a", ASSUMED, 0.1)
    rigid = cloths.rigid("a", 0.1)
    np.testing.assert_allclose(own.nodes[:, :, 0], rigid.nodes[:, :, 0], atol=1e-3)
    # It stretches by less than 1 %, and swings.
    np.testing.assert_allclose(own.nodes[0], rigid.nodes[0], atol=0.01 * cloths.SIDE)
    assert np.abs(own.nodes - rigid.nodes)[..., 1].max() > 0.02
    scenario, _ = scenario_of(own, cloths.GRIP)
    solver = ClothSolver("again", cloths.GRIP, ASSUMED)
    first, second = solver.predict(scenario), solver.predict(scenario)
    assert first.tobytes() == second.tobytes()
    np.testing.assert_allclose(first, own.nodes[1:], atol=2e-3)


def test_only_ratios_to_the_density_show():
    light = Properties(density=0.1, bend=1e-5, bend_damping=0.05, drag=0.5, added_mass=0.05)
    heavy = dataclasses.replace(light, density=0.2, bend=2e-5, drag=1.0, added_mass=0.1)
    other = dataclasses.replace(heavy, added_mass=0.05)
    one, two, three = (simulated("a", p, 0.05).nodes for p in (light, heavy, other))
    alike, apart = np.abs(one - two).mean(), np.abs(one - three).mean()
    # Stretch is not scaled.
    assert alike < 5e-4 and apart > 3 * alike


def test_a_fit_of_a_line_has_the_interval_of_its_slopes():
    rng = np.random.default_rng(0)
    slopes = 2.0 + 0.1 * rng.standard_normal(200)
    x = np.linspace(0.0, 1e-3, 5)
    found = fit(
        {"slope": Unknown(0.1, 10.0, 0.01)},
        [{"slope": 1.0}],
        lambda values: (values["slope"] - slopes[:, None]) * x,
        20,
    )
    assert found.values["slope"] == pytest.approx(slopes.mean(), rel=1e-4)
    low, high = found.intervals["slope"]
    assert high - low == pytest.approx(2 * 1.96 * slopes.std(ddof=1) / np.sqrt(200), rel=0.02)


@pytest.mark.long
def test_secret_properties_are_found_in_recordings_of_them(tmp_path):
    secret = dataclasses.replace(ASSUMED, drag=2.2, added_mass=0.1, length=1.02)
    for number, width in enumerate((0.06, 0.08, 0.1, 0.12, 0.14, 0.16, 0.18, 0.2)):
        cloths.write(tmp_path, simulated(f"range30_rep{number}", secret, width, frames=16))
    found, out = tmp_path / "found.json", tmp_path / "out.json"
    arguments = ["identify", "cloth", str(tmp_path), "--out", str(found)]
    output_of(*arguments)
    entry = json.loads(found.read_text())
    assert entry["recordings"] == 6
    for name in ("drag", "added_mass"):
        assert entry["properties"][name] == pytest.approx(getattr(secret, name), rel=0.1)
    # It is relative to the measured length, which has it.
    assert entry["properties"]["length"] == pytest.approx(1.0, abs=0.01)
    for name in identification.UNKNOWNS:
        low, high = entry["intervals"][name]
        assert low <= entry["properties"][name] <= high
    assert entry["properties"]["density"] == ASSUMED.density
    arguments = ["validate", "cloth", str(tmp_path), "--identified", str(found), "--out", str(out)]
    output_of(*arguments)
    content = json.loads(out.read_text())
    assert content["tests"] == ["range30_rep3", "range30_rep7"]
    error = {row["solver"]: row["error"] for row in content["measurements"]}
    assert 4 * error["cloth, identified"] < error["cloth, assumed"]
    assert error["cloth, assumed"] < error["nothing moves"]


def test_bad_input_is_refused():
    with pytest.raises(StoreError, match="no result of an identification"):
        read_identified(Properties, {"properties": {"bend": "soft"}})
    with pytest.raises(InvalidArgumentError, match="drag=-1"):
        dataclasses.replace(ASSUMED, drag=-1.0)
    with pytest.raises(InvalidArgumentError, match="recordings=4"):
        identification.identify([cloths.rigid("a", 0.1)] * 4)
