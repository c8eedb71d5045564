"""The simulated cable: mechanics by theory, markers, and properties found in its own recordings."""

import dataclasses
import json
import math

import mujoco
import numpy as np
import pytest

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.reality.rope import identification
from softgym_mj.reality.rope.cable import Properties, compiled
from softgym_mj.reality.rope.experiment import measure
from softgym_mj.reality.rope.recordings import HELD, Recording
from softgym_mj.reality.rope.scenario import Scenario, scenario_of
from softgym_mj.reality.rope.simulation import ASSUMED, CableSolver, marker_spacing
from tests.command import error_of, output_of
from tests.reality import cables

SPACING = np.array([0.02, 0.1, 0.09, 0.11, 0.1, 0.1, 0.03])  # [m]
GRAVITY = 9.81  # [m/s^2]
HANGING = 100  # Frames after which the cable hangs.


def simulated(
    properties: Properties = ASSUMED, frames: int = 120, width: float = 0.15
) -> Recording:
    """Returns a recording of a cable that this package simulates: hanging, one end is swung."""
    markers = np.zeros((2, len(SPACING) + 1, 3))
    markers[:, 1:, 0] = np.cumsum(SPACING)
    held = np.repeat(markers[:1, HELD], HANGING + frames, axis=0)
    held[:, 2:, 0] -= 0.1 * np.minimum(np.arange(len(held))[:, None] / HANGING, 1.0)
    time = np.arange(frames)[:, None] * 0.01
    held[HANGING:, 2:, 1] += width * np.sin(6.0 * time)
    held[HANGING:, 2:, 2] += 0.1 * np.sin(4.0 * time)
    moved = CableSolver("own", SPACING, properties).predict(Scenario(markers, held))
    return Recording("DLO1", "1", moved[HANGING:])


def test_each_vertex_has_the_mass_and_the_drag_of_the_cable_around_it():
    spacing = np.array([0.01, 0.03, 0.02])
    cable, model, _ = compiled(spacing, ASSUMED)
    lengths = np.array([0.005, 0.02, 0.025, 0.01])
    mass = model.body_mass[model.flex_vertbodyid[cable.vertex_ids]]
    np.testing.assert_allclose(mass, ASSUMED.density * lengths)
    drag = model.dof_damping.reshape(-1, 3)
    np.testing.assert_allclose(drag, np.repeat(ASSUMED.air_damping * lengths[:, None], 3, axis=1))


def test_a_free_fall_reaches_the_terminal_velocity():
    drag = dataclasses.replace(ASSUMED, air_damping=0.5)
    cable, model, data = compiled(np.full(20, 0.02), drag)
    mujoco.mj_step(model, data, 100)
    speed = GRAVITY * ASSUMED.density / 0.5
    np.testing.assert_allclose(cable.velocities()[:, 2], -speed, rtol=0.01)


def test_a_clamped_cable_deflects_as_a_beam():
    # The clamps are pairs of held vertices, as in recordings: half a segment of each pair bends.
    number, segment = 12, 0.4 / 12
    spacing = np.array([0.02, *np.full(number, segment), 0.02])
    stiff = dataclasses.replace(ASSUMED, bend=0.02, bend_damping=0.01, air_damping=0.1)
    cable, model, data = compiled(spacing, stiff)
    held = 0, 1, number + 1, number + 2
    for vertex in held:
        cable.hold(vertex)
    for _ in range(300):
        for vertex in held:
            cable.drive(vertex, cable.origin[vertex], 0.01)
        mujoco.mj_step(model, data)
    sag = GRAVITY * stiff.density * (0.4 + segment) ** 4 / (384.0 * stiff.bend)
    assert -cable.points()[:, 2].min() == pytest.approx(sag, rel=0.15)


def test_held_markers_follow_their_paths_and_predictions_repeat_bit_by_bit():
    recording = simulated()
    solver = CableSolver("again", SPACING, ASSUMED)
    scenario = scenario_of(recording)
    first, second = solver.predict(scenario), solver.predict(scenario)
    assert first.tobytes() == second.tobytes()
    np.testing.assert_allclose(first[:, HELD], scenario.held, atol=5e-4)
    # The vertices between markers are not recorded.
    found = measure(solver, [recording])
    assert found.error < 2e-3 and found.real_time_factor > 1.0
    with pytest.raises(InvalidArgumentError, match="scenario=9"):
        solver.predict(scenario_of(Recording("DLO1", "1", cables.swinging(markers=9))))


def test_spacing_is_measured_along_the_arc():
    recording = Recording("DLO1", "1", cables.swinging(frames=60))
    arc = cables.LENGTH / (cables.MARKERS - 1)  # An arc of 2 rad and half the length as radius.
    np.testing.assert_allclose(marker_spacing([recording]), arc, rtol=3e-3)
    chord = cables.LENGTH * math.sin(1.0 / (cables.MARKERS - 1))
    assert marker_spacing([recording]).mean() > chord


def test_secret_properties_are_found_in_recordings_of_them(tmp_path, monkeypatch):
    secret = dataclasses.replace(ASSUMED, bend=4e-3, bend_damping=0.02, air_damping=0.1)
    monkeypatch.setattr(identification, "STARTS", (1.0,))
    for split, widths in (("train", (-0.2, -0.1, 0.1, 0.15, 0.2)), ("eval", (0.25,))):
        for number, width in enumerate(widths):
            markers = simulated(secret, 40, width).markers
            cables.write(tmp_path, "DLO4", split, str(number), markers)
    folder, found, out = (str(tmp_path / name) for name in ("", "found.json", "out.json"))
    only = [folder, "--cable", "DLO4"]
    arguments = ["identify", "rope", *only, "--recordings", "5", "--out", found]
    output_of(*arguments)
    entry = json.loads((tmp_path / "found.json").read_text())["DLO4"]
    for name in identification.UNKNOWNS:
        value, (low, high) = entry["properties"][name], entry["intervals"][name]
        # The measured spacing is not the exact one.
        assert value == pytest.approx(getattr(secret, name), rel=0.15)
        assert low <= value <= high
    assert entry["properties"]["density"] == ASSUMED.density
    arguments = ["validate", "rope", *only, "--identified", found, "--out", out]
    output_of(*arguments)
    measured = json.loads((tmp_path / "out.json").read_text())["measurements"]
    error = {row["solver"]: row["error"] for row in measured}
    assert 4 * error["rope, identified"] < error["rope, assumed"] < error["nothing moves"]


def test_few_recordings_are_refused():
    with pytest.raises(InvalidArgumentError, match="recordings=4"):
        identification.identify([simulated(frames=10)] * 4)


def test_a_file_without_the_cables_is_refused(tmp_path):
    found = tmp_path / "found.json"
    found.write_text('{"DLO2": {}}')
    error = error_of("validate", "rope", tmp_path, "--cable", "DLO1", "--identified", found)
    assert isinstance(error, StoreError) and "has no entry of DLO1" in str(error)
