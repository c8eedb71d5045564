"""Photographs show what MuJoCo's camera shows, in the colors of its materials."""

import importlib
import pathlib
import re
import sys

import imageio.v3 as imageio
import mujoco
import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError, UnavailableError
from softgym_mj.registry import TaskRecord
from softgym_mj.rendering import photo
from softgym_mj.rendering.offscreen import CameraView, camera_ids, refresh
from softgym_mj.rendering.photo import shapes
from softgym_mj.rendering.photo.materials import FINISHES, Clear, linear
from softgym_mj.rendering.photo.scene import Scene
from softgym_mj.rendering.textures import texture_of
from tests.command import error_of, output_of

SIZE = 320  # Image size [pixels]: a rope is some pixels wide.
# Tasks, and what of them is looked at: parts of names in the model.
SEEN = {
    "fold_cloth": ("cloth/",),
    "straighten_rope": ("rope/",),
    "pour_water": ("cup/", "target/", "water/"),
}


@pytest.fixture(name="mi", scope="module")
def _mi():
    mitsuba = importlib.import_module("mitsuba")
    mitsuba.set_variant("scalar_rgb")
    return mitsuba


@pytest.fixture(name="env", scope="module", params=SEEN)
def _env(request):
    env = softgym_mj.load(request.param, split="all")
    env.reset(806)
    yield env
    env.close()


def scene_of(mi, physics):
    model = physics.model.ptr
    camera = mujoco.MjvCamera()
    camera.type, camera.fixedcamid = mujoco.mjtCamera.mjCAMERA_FIXED, camera_ids(model)["task"]
    refresh(model, physics.data.ptr)
    return Scene(mi, model, physics.data.ptr, camera)


def seen(mi, scene, size=SIZE):
    """Names (size, size) of what each pixel shows, empty for nothing."""
    layer = {"type": "aov", "aovs": "shape:shape_index"}
    loaded = mi.load_dict(
        {"type": "scene", "integrator": layer, "sensor": scene.sensor(size), **scene.contents}
    )
    names = np.array(["", *(scene.names[shape.id()] for shape in loaded.shapes())])
    return names[np.asarray(mi.render(loaded, spp=1))[..., -1].astype(int)]


def seen_by_mujoco(physics):
    ids = CameraView("task", SIZE, SIZE).segmentation(physics)
    model = physics.model.ptr
    names = [
        mujoco.mj_id2name(model, int(kind), int(number)) if number >= 0 else ""
        for number, kind in ids.reshape(-1, 2)
    ]
    return np.array(names).reshape(SIZE, SIZE)


def mask(names, wanted):
    return np.logical_or.reduce([np.char.startswith(names, name) for name in wanted])


def test_silhouettes_are_those_of_mujoco(mi, env, request):
    wanted = SEEN[request.node.callspec.params["env"]]
    own = mask(seen(mi, scene_of(mi, env.physics)), wanted)
    expected = mask(seen_by_mujoco(env.physics), wanted)
    assert expected.sum() > 100
    assert (own & expected).sum() / (own | expected).sum() > 0.9


def test_a_still_leaves_the_state_alone(env):
    data = env.physics.data.ptr
    kinds = ("qpos", "qvel", "act", "ctrl", "mocap_pos", "qacc_warmstart", "plugin_state")
    before = {kind: getattr(data, kind).copy() for kind in kinds}
    picture = photo.still(env, size=48, samples=4)
    assert picture.shape == (48, 48, 3) and picture.dtype == np.uint8
    assert 60 < picture.mean() < 230 and picture.std() > 5
    assert all(np.array_equal(getattr(data, kind), before[kind]) for kind in kinds)


def test_cloth_has_the_color_of_its_texture(mi):
    """It lies flat on the table: the same light falls on both, and both are matt."""
    env = softgym_mj.load("fold_cloth", split="all")
    env.reset(806)
    model = env.physics.model.ptr
    light = linear(photo.still(env, size=64, samples=32, denoise=False) / 255.0)
    scene = scene_of(mi, env.physics)
    names = seen(mi, scene, 64)
    weave = texture_of(model, model.skin_matid[0])
    is_up = scene.seen.skinnormal.reshape(-1, 3)[:, 2] > 0.5
    columns, rows = (model.skin_texcoord[is_up] * weave.shape[1::-1]).astype(int).T
    albedo = linear(weave[rows, columns] / 255.0).mean(axis=0)
    table = linear(texture_of(model, model.material("table").id) / 255.0)
    on_table = light[names == "table"].mean(axis=0) / table.mean(axis=(0, 1))
    on_cloth = light[mask(names, ["cloth/"])].mean(axis=0)
    np.testing.assert_allclose(on_cloth, albedo * on_table, rtol=0.2, atol=0.02)


BALL = """<mujoco><asset><material name="{}" rgba="1 1 1 1" specular="0.2"/></asset>
<worldbody><geom type="sphere" size="0.1" material="{}"/></worldbody></mujoco>"""


@pytest.mark.parametrize("name", [*FINISHES, "other"])
def test_no_material_shines_by_itself(mi, name):
    """A white furnace: a white ball in light of 1 from all sides reflects no more.

    But for what Mitsuba's "principled" adds where it has reflections, 6 %.
    """
    model = mujoco.MjModel.from_xml_string(BALL.format(name, name))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.distance = 1.0
    scene = Scene(mi, model, data, camera)
    loaded = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 16},
            "sensor": scene.sensor(24),
            "light": {"type": "constant"},
            **scene.contents,
        }
    )
    middle = np.asarray(mi.render(loaded, spp=64))[10:14, 10:14].mean()
    assert (0.5 if isinstance(FINISHES.get(name), Clear) else 0.7) < middle < 1.07


VOLUMES = {
    "BOX": ([0.1, 0.2, 0.3], 8 * 0.1 * 0.2 * 0.3),
    "SPHERE": ([0.2, 0.2, 0.2], 4 / 3 * np.pi * 0.2**3),
    "ELLIPSOID": ([0.1, 0.2, 0.3], 4 / 3 * np.pi * 0.1 * 0.2 * 0.3),
    "CAPSULE": ([0.1, 0.1, 0.3], np.pi * 0.1**2 * (0.6 + 4 / 3 * 0.1)),
    "CYLINDER": ([0.1, 0.1, 0.3], np.pi * 0.1**2 * 0.6),
}


@pytest.mark.parametrize("kind", VOLUMES)
def test_shapes_are_closed_and_turned_outwards(kind):
    size, volume = VOLUMES[kind]
    shape = shapes.shape(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"), np.array(size))
    a, b, c = (shape.vertices[corner] for corner in shape.faces.T)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(volume, rel=0.01)
    across = np.cross(b - a, c - a)
    has_area = np.linalg.norm(across, axis=1) > 1e-9
    for corner in shape.faces[has_area].T:
        assert (np.einsum("ij,ij->i", across[has_area], shape.normals[corner]) > 0.0).all()


@pytest.mark.long
def test_the_page_runs(monkeypatch, tmp_path):
    page = (pathlib.Path(__file__).parents[2] / "docs" / "pictures.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(compile(code, "pictures.md", "exec"), names)
    assert names["picture"].shape == (48, 48, 3)
    assert len(imageio.imread(tmp_path / "rope.mp4", plugin="FFMPEG")) == 3


@pytest.mark.parametrize("module", ["mitsuba", "pyoidn"])
def test_a_missing_extra_is_named(module, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    error = error_of("photo", "pour_water")
    assert isinstance(error, UnavailableError) and "pip install '.[photo]'" in str(error)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("--camera above", "camera='above'"),
        ("--size 0", "size=0"),
        ("--size 2000", "size=2000"),
        ("--step 3", "step=3 is not valid: expected a whole number in 0..2"),
        ("--variation 1000", "variation=1000"),
    ],
)
def test_what_is_refused(options, message, monkeypatch, tmp_path):
    monkeypatch.setitem(softgym_mj.TASKS, "short", TaskRecord("straighten_rope", horizon=2))
    command = ["photo", "short", "--samples", "1", "--out", tmp_path / "still.png"]
    error = error_of(*command, *options.split())
    assert isinstance(error, InvalidArgumentError) and message in str(error)


def test_the_command_writes_stills_and_films(monkeypatch, tmp_path):
    monkeypatch.setitem(softgym_mj.TASKS, "short", TaskRecord("straighten_rope", horizon=2))
    command = ["photo", "short", "--size", "32", "--samples", "2", "--no-denoise"]
    still, film = tmp_path / "still.png", tmp_path / "film.mp4"
    for options in (["--step", "1", "--out", still], ["--video", "--every", "2", "--out", film]):
        output_of(*command, *map(str, options))
    assert imageio.imread(still).shape == (32, 32, 3)
    frames = imageio.imread(film, plugin="FFMPEG")
    assert frames.shape == (2, 32, 32, 3)
