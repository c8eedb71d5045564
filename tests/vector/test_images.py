"""Images of rows of arrays: their oracle is what OpenGL draws of a `SoftGymEnv`."""

import ctypes
import dataclasses

import mujoco
import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj.batch.device import CpuDevice, function
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies.reactive import pour_water
from softgym_mj.rendering.batch import Pictures, describe, layout
from softgym_mj.rendering.batch.rigid import SIDES, mesh_of
from softgym_mj.rendering.look import LOOKS, PAPER
from softgym_mj.rendering.observables import LABELS, WRIST_RGB
from softgym_mj.vector.batch.cameras import IMAGES
from tests.kinds import by_kind
from tests.native.torch_device import TorchDevice
from tests.rendering.test_looks import volume

OBJECT = LABELS.index("object")
FIXED = [name for name in IMAGES if name != WRIST_RGB]  # By cameras that do not move.
SIZE = (72, 64)
# No faults of a sensor: a batch has none.
SEEN_OTHERWISE = {"visual": "in_distribution", "sensor": "nominal"}


def overlap(first, second):
    """Intersection over union of two masks."""
    return (first & second).sum() / (first | second).sum()


def check_images(seen, alone, is_water=False, color=3.0):
    """Checks that images are close to those of an environment; `color`: mean difference."""
    masks = [labels == OBJECT for labels in (seen["segmentation"], alone["segmentation"])]
    assert overlap(*masks) >= (0.9 if is_water else 0.97)
    others = [
        np.where(mask, 0, s["segmentation"]) for mask, s in zip(masks, (seen, alone), strict=True)
    ]
    assert (others[0] != others[1]).mean() < 0.02
    for name in ("depth", "external_depth"):
        away = np.abs(seen[name] - alone[name])
        assert np.median(away) < 1e-4
        assert (away > 5e-3).mean() < (0.06 if is_water else 0.01), name  # Rims.
    for name in ("rgb", "external_rgb"):
        away = np.abs(seen[name].astype(int) - alone[name]).mean()
        assert away < (5.0 if is_water else color), name


@pytest.mark.parametrize(
    ("task", "domain"),
    [
        *by_kind("nominal", of=("fold_cloth", "drop_cloth", "transport_water")),
        *((t, SEEN_OTHERWISE) for t in ("drop_fold_cloth", "rope_configuration", "pour_water")),
    ],
)
def test_images_look_like_those_of_an_environment(task, domain):
    settings = {
        "observation": FIXED, "image_size": SIZE, "split": "all", "fidelity": "fast",
        "domain": domain,
    }  # fmt: skip
    envs = softgym_mj.make_vec(task, 2, device="host", **settings)
    env = SoftGymEnv(task, **settings)
    assert envs.single_observation_space == env.observation_space
    options = {"variation": [803, 811]}
    (seen, _), (alone, _) = envs.reset(options=options), env.reset(options={"variation": 811})
    is_water = "water" in softgym_mj.TASKS[task].tags
    color = 3.5 if task == "hang_cloth" else 3.0  # Edges of thin posts.
    check_images({name: array[1] for name, array in seen.items()}, alone, is_water, color)
    action = np.full(env.action_space.shape, 0.5, np.float32)
    seen, *_ = envs.step(np.stack([action, action]))
    alone, *_ = env.step(action)
    assert all(seen[name].dtype == alone[name].dtype for name in alone)
    check_images({name: array[1] for name, array in seen.items()}, alone, is_water, color)
    envs.close()
    env.close()


@pytest.mark.long
def test_water_is_drawn_behind_what_is_before_it_and_before_what_is_behind_it():
    settings = {
        "observation": ["rgb", "segmentation", "markov"], "image_size": SIZE, "split": "all",
        "fidelity": "fast",
    }  # fmt: skip
    envs = softgym_mj.make_vec("pour_water", 1, device="host", **settings)
    env = SoftGymEnv("pour_water", **settings)
    envs.reset(options={"variation": [860]})
    alone, _ = env.reset(options={"variation": 860})
    for number in range(25):  # The target is seen beside the cup, then through it, then below it.
        action = pour_water(alone["markov"]).astype(np.float32)
        seen, *_ = envs.step(action[None])
        alone, *_ = env.step(action)
        for label in (OBJECT, LABELS.index("container")):
            own = (seen["segmentation"][0] == label) & (alone["segmentation"] == label)
            away = (seen["rgb"][0].astype(int) - alone["rgb"])[own]
            if number % 8 == 0:
                assert np.abs(away).mean() < 6.0
                assert np.abs(away.mean(axis=0)).max() < 4.0
    envs.close()
    env.close()


MODEL = """
<mujoco>
  <custom><text name="softgym_mj_look" data="fast"/></custom>
  <visual>
    <headlight ambient="0.25 0.25 0.25" diffuse="0.5 0.5 0.5" specular="0 0 0"/>
    <map znear="0.01"/>
  </visual>
  <worldbody>
    <light type="directional" dir="0 0 -1" diffuse="0.125 0.125 0.125" specular="0 0 0"/>
    <camera name="above" pos="0 0 2" fovy="60"/>
    <geom name="table" type="box" size="5 5 0.5" pos="0 0 -0.5" rgba="0.9 0.4 0.2 1"/>
    <body name="ball" pos="0.3 0 0.25"><geom type="sphere" size="0.25" rgba="0 0 1 1"/></body>
  </worldbody>
</mujoco>
"""


def _ball(device, number=1):
    """Pictures of environments with a ball on a table, and where it is drawn in them."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    body = model.body("ball").id
    pictures = Pictures(number, 1, 1, 1, (65, 65), device)
    scene = pictures.load(describe(model, ["above"], {body: 0}, {"actor": ()}))
    scenes = device.put(np.full(number, scene))
    return pictures, scenes, device.put(np.zeros((number, 1, 3)))


def test_distances_and_colors_of_a_ball_on_a_table():
    device = CpuDevice()
    pictures, scenes, points = _ball(device)
    poses = np.array([[[0.0, 0.0, 0.25, 1.0, 0.0, 0.0, 0.0]]])
    _, distances = pictures.surfaces(scenes, points, poses)
    found = distances[0, 0]
    rows, columns = np.mgrid[:65, :65]
    slope = np.tan(np.radians(30.0))
    x, y = slope * (2 * (columns + 0.5) / 65 - 1), slope * (1 - 2 * (rows + 0.5) / 65)
    # |o + t d - c| = r for o - c = (0, 0, 1.75), d = (x, y, -1).
    a, b, c = x**2 + y**2 + 1, -1.75, 1.75**2 - 0.25**2
    root = b**2 - a * c
    ball = (-b - np.sqrt(np.maximum(root, 0.0))) / a
    np.testing.assert_allclose(found, np.where(root >= 0.0, ball, 2.0), atol=2e-5)
    colors = pictures.colors(scenes, points, poses)[0, 0]
    # Seen and lit from straight above: 0.25 + 0.5 + 0.125 of its color.
    np.testing.assert_array_equal(colors[0, 0], np.round(255 * 0.875 * np.array([0.9, 0.4, 0.2])))
    assert colors[32, 32].tolist() == [0, 0, round(255 * 0.875)]


def test_no_bit_depends_on_where_and_in_which_order_things_are_done():
    poses = np.array([[[0.1 * i, 0.05, 0.3, 1.0, 0.0, 0.0, 0.0]] for i in range(3)])
    expected = None
    for device in (CpuDevice(), CpuDevice(2, 1), CpuDevice(1, 5), TorchDevice()):
        pictures, scenes, points = _ball(device, 3)
        told = scenes, points, device.put(poses)
        found = [device.get(array) for array in (pictures.colors(*told), *pictures.surfaces(*told))]
        expected = expected or found
        for a, b in zip(expected, found, strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("task", ["pour_water", "spread_cloth", "straighten_rope"])
def test_turns_change_no_bit_of_what_deforms(task):
    env = softgym_mj.load(task, split="all", fidelity="fast")
    env.reset(803)
    model, scene = env.physics.model.ptr, env.task.scene
    points = next(iter(scene.points().values()))[None]
    described = describe(model, ["task"], {}, scene.segmentation_models)
    found = []
    for device in (CpuDevice(), CpuDevice(1, 1), CpuDevice(1, 3)):
        pictures = Pictures(1, points.shape[1], 0, 1, (48, 48), device)
        told = np.array([pictures.load(described)]), points, np.zeros((1, 0, 7))
        found.append([pictures.colors(*told), *pictures.surfaces(*told)])
    assert (found[0][1] == OBJECT).any()
    for others in found[1:]:
        for a, b in zip(found[0], others, strict=True):
            np.testing.assert_array_equal(a, b)


def test_shapes_as_meshes():
    shapes = '<geom type="box" size="1 2 3"/><geom type="cylinder" size="1 2"/>'
    shapes += '<geom type="sphere" size="1"/><geom type="capsule" size="1 2"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody>{shapes}<geom type="ellipsoid" size="1 1 1"/></worldbody></mujoco>'
    )
    box, cylinder, sphere, capsule = (mesh_of(model, i) for i in range(4))
    polygon = SIDES / 2.0 * np.sin(2.0 * np.pi / SIDES)  # Area of a regular one in a unit circle.
    volumes = [volume(mesh.places, mesh.faces) for mesh in (box, cylinder, sphere, capsule)]
    assert volumes[0] == pytest.approx(48.0)
    assert volumes[1] == pytest.approx(4.0 * polygon)
    assert volumes[2] == pytest.approx(4.0 / 3.0 * np.pi, rel=0.05)
    assert volumes[3] == pytest.approx(volumes[2] + 4.0 * polygon)
    for mesh in (box, cylinder, sphere, capsule):
        a, b, c = mesh.places[mesh.faces].swapaxes(0, 1)
        outward = np.cross(b - a, c - a)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        for corner in mesh.faces.T:
            assert ((outward * mesh.normals[corner]).sum(1) > 0.9).all()
    assert mesh_of(model, 4) is None


def test_structs_are_those_of_the_program():
    sizes = np.zeros(7, np.int64)
    function("pictures", "layout")(sizes.ctypes.data_as(ctypes.c_void_p))
    kinds = (
        layout.MATERIAL, layout.SOLID, layout.RIGID, layout.LIGHT, layout.EYE, layout.TEXTURE,
        layout.SCENE,
    )  # fmt: skip
    assert sizes.tolist() == [np.dtype(kind).itemsize for kind in kinds]


def test_an_environment_without_a_scene_is_not_drawn():
    pictures, scenes, points = _ball(CpuDevice(), 2)
    scenes[0] = 0
    poses = np.array([[[0.0, 0.0, 0.25, 1.0, 0.0, 0.0, 0.0]]] * 2)
    colors = pictures.colors(scenes, points, poses)
    assert not colors[0].any() and colors[1].all(axis=-1).any()


def test_what_cannot_be_drawn_is_refused_by_name(monkeypatch):
    small = dataclasses.replace(PAPER, texture_size=16)  # Refused once it has drawn its textures.
    monkeypatch.setitem(LOOKS, "paper", small)
    for settings, name in (
        ({"observation": "point_cloud"}, "observation='point_cloud'"),
        ({"observation": "rgb", "look": "paper"}, "look='paper'"),
        (
            {"observation": "rgb", "domain": "in_distribution"},
            "an image with the sensor faults .'sensor_blur'",
        ),
    ):
        with pytest.raises(InvalidArgumentError, match=name):
            softgym_mj.make_vec("straighten_rope", 1, device="host", **settings).reset()
    ellipsoid = MODEL.replace('type="sphere" size="0.25"', 'type="ellipsoid" size="0.2 0.1 0.1"')
    with pytest.raises(InvalidArgumentError, match="mjGEOM_ELLIPSOID"):
        describe(mujoco.MjModel.from_xml_string(ellipsoid), ["above"], {}, {})


def test_images_are_tensors_where_states_are():
    device = TorchDevice()
    pictures, scenes, points = _ball(device, 2)
    poses = device.put(np.array([[[0.0, 0.0, 0.25, 1.0, 0.0, 0.0, 0.0]]] * 2))
    colors = pictures.colors(scenes, points, poses)
    assert isinstance(colors, torch.Tensor) and colors.dtype == torch.uint8
    later = pictures.colors(scenes, points, poses + 0.1)
    assert not torch.equal(colors, later)  # The first one is left alone.
