"""Validation with markers: on recordings that the package's own simulation and writer make."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from softgym_mj.cli import commands
from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.reality import marker_scene
from softgym_mj.reality.markers import FRAME_RATE, Markers, write_markers
from softgym_mj.reality.meshes import grid
from softgym_mj.reality.replay import Hold, replay
from softgym_mj.reality.validation import marker_cases

FABRIC = Fabric.named("black_denim")
ROWS, COLUMNS, ACROSS, DOWN = 4, 5, 0.12, 0.11  # [m]
FINER = 2  # Edges of the mesh between two markers: what the scene makes of 6 cm, too.


@pytest.fixture(name="shaken", scope="module")
def _shaken():
    """A hanging sheet whose upper corners are shaken, as 20 markers see it: 0.25 s."""
    mesh = grid(
        (COLUMNS - 1) * ACROSS, (ROWS - 1) * DOWN, (ROWS - 1) * FINER + 1, (COLUMNS - 1) * FINER + 1
    )
    start = mesh.points[:, [0, 2, 1]] + [0.0, 0.0, 1.0]
    corners = (0, (COLUMNS - 1) * FINER)

    def hands(times):
        way = 0.05 * (1.0 - np.cos(12.0 * np.asarray(times)))
        return start[list(corners)] + way[:, None, None] * [0.2, 1.0, 0.0]

    times = np.arange(30) / FRAME_RATE
    found = replay(mesh, FABRIC, [Hold(corners, hands)], times, start=start, floor=None)
    across = (COLUMNS - 1) * FINER + 1
    vertices = [i * FINER * across + j * FINER for i in range(ROWS) for j in range(COLUMNS)]
    return Markers(np.arange(30), times, found.positions[:, vertices])


def test_a_scene_is_what_was_recorded(shaken):
    scene = marker_scene.scene(shaken, spacing=0.06)
    assert scene.shape == (ROWS, COLUMNS)
    assert scene.held == (0, COLUMNS - 1)
    assert list(scene.free) == [1, 2, 3, *range(COLUMNS, ROWS * COLUMNS)]
    rest = scene.mesh.points[scene.vertices].reshape(ROWS, COLUMNS, 3)
    np.testing.assert_allclose(np.diff(rest[..., 0], axis=1), ACROSS, rtol=0.02)
    np.testing.assert_allclose(np.diff(rest[..., 1], axis=0), -DOWN, rtol=0.02)
    np.testing.assert_allclose(scene.start()[scene.vertices], shaken.positions[0], atol=1e-9)
    finer = marker_scene.scene(shaken, spacing=0.03)
    np.testing.assert_allclose(finer.start()[finer.vertices], shaken.positions[0], atol=1e-9)
    assert finer.mesh.lengths.max() < 0.03 * 2**0.5 + 1e-9


def test_columns_may_come_first(shaken):
    turned = shaken.positions.reshape(-1, ROWS, COLUMNS, 3).swapaxes(1, 2).reshape(-1, 20, 3)
    scene = marker_scene.scene(Markers(shaken.frames, shaken.times, turned))
    assert scene.shape == (COLUMNS, ROWS)
    assert scene.held == (0, ROWS * (COLUMNS - 1))


def test_other_orders_and_numbers_are_refused(shaken):
    mixed = shaken.positions[:, np.random.default_rng(0).permutation(20)]
    with pytest.raises(StoreError, match=r"shake\.csv: markers are not numbered row by row"):
        marker_scene.scene(Markers(shaken.frames, shaken.times, mixed), name="shake.csv")
    few = Markers(shaken.frames, shaken.times, shaken.positions[:, :7])
    with pytest.raises(StoreError, match="7 markers; expected 20 or 12"):
        marker_scene.scene(few)
    with pytest.raises(InvalidArgumentError, match="held"):
        marker_scene.scene(shaken, held=(20,))
    with pytest.raises(InvalidArgumentError, match="unit"):
        marker_scene.scene(shaken, unit=0.0)


def test_what_was_simulated_is_found_again(shaken, tmp_path):
    write_markers(tmp_path / "denim_shake.csv", shaken)
    millimetres = Markers(shaken.frames, shaken.times, 1e3 * shaken.positions)
    write_markers(tmp_path / "denim_twist.csv", millimetres)
    files = marker_cases.check(tmp_path)
    (case,) = marker_cases.run(tmp_path, files[:1], FABRIC, spacing=0.06)
    (other,) = marker_cases.run(tmp_path, files[1:], FABRIC, spacing=0.06, unit=1e-3)
    # The same but for its size, which is told from distances in motion: half a per cent larger.
    assert case.mean("marker_error") < 3e-3
    assert other.mean("marker_error") == pytest.approx(case.mean("marker_error"), rel=0.05)
    assert case.columns["marker_error"][0] < 1e-9
    free = [1, 2, 3, *range(COLUMNS, 20)]
    moved = shaken.positions[-1, free] - shaken.positions[0, free]
    rms = np.sqrt(np.mean(np.sum(moved**2, axis=1)))
    assert case.columns["persistence_marker_error"][-1] == pytest.approx(rms)
    assert case.mean("marker_error") < 0.1 * case.mean("persistence_marker_error")
    (wrong,) = marker_cases.run(tmp_path, files[:1], FABRIC, spacing=0.06, held=(0,))
    assert wrong.mean("marker_error") > 10.0 * case.mean("marker_error")


def test_the_command_ranks_what_twists(shaken, tmp_path):
    write_markers(tmp_path / "denim_twist.csv", shaken)
    out = tmp_path / "out"
    arguments = ["validate", "markers", str(tmp_path), "--fabric", "black_denim", "--spacing",
                 "0.06", "--no-film", "--after", "0.1", "--out", str(out)]  # fmt: skip
    result = CliRunner().invoke(commands.app, arguments)
    assert result.exit_code == 0, result.output
    found = json.loads((out / "report.json").read_text())
    (group,) = found["groups"].values()
    assert (group["ranked"]["rank"], group["ranked"]["of"]) == (1, 4)
    case = found["cases"]["denim_twist"]
    assert (case["frames"], case["counted"]) == (30, 18)
    assert any("held" in note for note in case["notes"])


def test_an_empty_folder_says_where_the_data_are(tmp_path):
    with pytest.raises(StoreError, match="Zenodo record 14644526"):
        marker_cases.check(tmp_path)
