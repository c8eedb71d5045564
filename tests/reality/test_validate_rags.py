"""Validation with rags: on data sets that the package's own simulation and writers make."""

import csv
import dataclasses
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from softgym_mj.cli import commands
from softgym_mj.entities.sheet import Fabric
from softgym_mj.exceptions import StoreError
from softgym_mj.reality import rag_scene, rags
from softgym_mj.reality.clouds import Cloud
from softgym_mj.reality.metrics import rag_distances
from softgym_mj.reality.surfaces import sample_surface
from softgym_mj.reality.validation import baselines, rag_cases, report

FRAMES = 6
SPACING = 0.1  # [m] Coarse, and fast.
FABRIC = Fabric.named("white_dots")


@pytest.fixture(name="data", scope="module")
def _data(tmp_path_factory):
    """Two repeats of a rag as it is simulated; the second one is 3 mm higher. And one of another.

    Clouds are points of the surface on the camera's side.
    """
    folder = tmp_path_factory.mktemp("rags")
    mesh = rag_scene.rag(SPACING)
    times = np.arange(FRAMES) / rags.FRAME_RATE
    found = rag_scene.replay_rag(FABRIC, "dynamic", times, mesh=mesh)
    surface = sample_surface(mesh.points, mesh.triangles, 0.02)
    for cloth, repeat, shift in (("linen", 0, 0.0), ("linen", 1, 0.003), ("cotton", 2, 0.0)):
        clouds = []
        for positions in found.positions:
            points = surface.points(positions) + [0.0, 0.0, shift]
            clouds.append(Cloud(points, np.full(points.shape, 200, np.uint8)))
        rags.write_sequence(folder, cloth, repeat, "dynamic", clouds)
    return folder, found


def measured(folder, **changes):
    arguments = {"frames": FRAMES, "spacing": SPACING, "sampled": 0.02} | changes
    found = rag_cases.check(folder, primitives=["dynamic"])
    return [*rag_cases.run(folder, found, FABRIC, **arguments)]


def test_what_was_simulated_is_found_again(data):
    folder, found = data
    cases = {case.name: case for case in measured(folder)}
    assert list(cases) == ["cotton_2/dynamic", "linen_0/dynamic", "linen_1/dynamic"]
    exact, raised, alone = (cases[f"{name}/dynamic"] for name in ("linen_0", "linen_1", "cotton_2"))
    # Vertices and samples of the surface are among the points of the cloud.
    np.testing.assert_allclose(exact.columns["chamfer"], 0.0, atol=1e-12)
    np.testing.assert_allclose(exact.columns["surface_chamfer"], 0.0, atol=1e-12)
    # All points are seen but those that a fold hides: the cloud has them all.
    assert exact.mean("symmetric_visible") < 2e-3
    # Each is 3 mm from its own, by both norms, and nothing is nearer in a sheet that hangs.
    assert raised.mean("chamfer") == pytest.approx(3e-3, rel=0.05)
    assert raised.mean("hausdorff") == pytest.approx(3e-3, rel=0.05)
    assert exact.mean("real_chamfer") == pytest.approx(3e-3, rel=0.05)
    assert "real_chamfer" not in alone.columns
    # The cloud of the first frame held still is what it is.
    first = rag_scene_points(folder, 0)
    later = rag_distances(first, rag_scene_points(folder, FRAMES - 1))
    assert exact.columns["persistence_chamfer"][-1] == pytest.approx(later.chamfer)
    assert exact.columns["persistence_chamfer"][0] == 0.0
    assert exact.columns["lowest"].min() == pytest.approx(
        min(found.positions[..., 2].min(axis=1)) - rag_scene.TABLE, abs=1e-9
    )
    assert exact.columns["strain_99"].max() <= found.strain_99
    assert not exact.failures
    assert exact.counted.all()
    assert any("assumed" in note for note in exact.notes)


def rag_scene_points(folder, frame):
    return rags.read_sequence(folder, "linen", 0, "dynamic", FRAMES)[frame].points


def test_ranks_and_spreads_are_those_of_the_columns(data):
    cases = measured(data[0])
    found = report.summary(cases, "chamfer", baselines.RAGS, {}, [])
    linen = found["groups"]["linen/dynamic"]
    means = [case.mean("chamfer") for case in cases if case.group == "linen/dynamic"]
    assert linen["columns"]["chamfer"]["mean"] == pytest.approx(np.mean(means))
    assert linen["columns"]["chamfer"]["sd"] == pytest.approx(abs(means[0] - means[1]) / 2**0.5)
    assert (linen["ranked"]["rank"], linen["ranked"]["of"]) == (1, 5)
    assert found["groups"]["cotton/dynamic"]["columns"]["chamfer"]["sd"] is None


def test_ranks_by_hand():
    others = {"a": 0.1, "b": 0.2, "c": 0.3}
    assert [baselines.rank(x, others) for x in (0.05, 0.1, 0.15, 0.3, 0.9)] == [1, 1, 2, 3, 4]
    assert baselines.rank(float("nan"), others) is None


def test_frames_that_do_not_count_are_left_out_of_means(data):
    case = measured(data[0])[0]
    cut = dataclasses.replace(case, counted=np.arange(FRAMES) < 2)
    assert cut.mean("persistence_chamfer") == case.columns["persistence_chamfer"][:2].mean()


def test_the_command_writes_what_it_measured(data, tmp_path):
    result = CliRunner().invoke(
        commands.app,
        ["validate", "rags", str(data[0]), "--frames", str(FRAMES), "--spacing", str(SPACING),
         "--sampled", "0.02", "--primitive", "dynamic", "--cloth", "linen", "--out", str(tmp_path)],
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert "Missing: linen_2/dynamic" in " ".join(result.output.split())
    found = json.loads((tmp_path / "report.json").read_text())
    assert found["missing"] == ["linen_2/dynamic"]
    assert found["settings"]["fabric"] == dataclasses.asdict(FABRIC)
    with (tmp_path / "frames.csv").open() as file:
        rows = [*csv.DictReader(file)]
    assert len(rows) == 2 * FRAMES
    means = found["cases"]["linen_1/dynamic"]["means"]
    own = [float(row["chamfer"]) for row in rows if row["case"] == "linen_1/dynamic"]
    assert means["chamfer"] == pytest.approx(np.mean(own))
    for name in ("linen_0_dynamic.mp4", "linen_1_dynamic.mp4", "curves.png"):
        assert (tmp_path / name).stat().st_size > 1000


def test_parameters_replace_those_of_the_fabric(data, tmp_path):
    file = tmp_path / "parameters.json"
    arguments = ["validate", "rags", str(data[0]), "--frames", str(FRAMES), "--spacing", "0.1",
                 "--sampled", "0.05", "--primitive", "dynamic", "--cloth", "cotton", "--no-film",
                 "--parameters", str(file), "--out", str(tmp_path)]  # fmt: skip
    file.write_text(json.dumps({"density": 0.25}))
    assert CliRunner().invoke(commands.app, arguments).exit_code == 0
    settings = json.loads((tmp_path / "report.json").read_text())["settings"]
    assert settings["fabric"] == dataclasses.asdict(dataclasses.replace(FABRIC, density=0.25))
    file.write_text(json.dumps({"weight": 0.25}))
    failed = CliRunner().invoke(commands.app, arguments)
    assert failed.exit_code != 0
    assert "'weight' is unknown" in str(failed.exception)


def test_damage_is_named_and_nothing_is_downloaded(data, tmp_path):
    with pytest.raises(StoreError, match=r"Zenodo record 13823986.*268d07d9"):
        rag_cases.check(tmp_path)
    clouds = rags.read_sequence(data[0], "cotton", 2, "dynamic", FRAMES)
    rags.write_sequence(tmp_path, "cotton", 2, "dynamic", clouds[:-1])
    found = rag_cases.check(tmp_path, primitives=["dynamic"])
    assert len(found.missing) == 8
    with pytest.raises(StoreError, match=r"00005\.ply: a missing frame"):
        next(rag_cases.run(tmp_path, found, FABRIC, frames=FRAMES, spacing=SPACING))
