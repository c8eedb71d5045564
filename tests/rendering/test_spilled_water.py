"""Pictures of water that lies about in drops: their oracle is a ball around each particle."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.batch.device import CpuDevice
from softgym_mj.rendering.batch import Pictures, describe
from softgym_mj.rendering.observables import LABELS, LabeledView

SIZE = 96, 96
OBJECT = LABELS.index("object")
DROP = 1.1  # Radius of a drop as cells of 1.25 spacings show it [spacings].


@pytest.fixture(name="env", scope="module")
def _env():
    env = softgym_mj.load("transport_water", split="all")
    env.reset(3)
    return env


def _spill(env, spread):
    """Lets particles lie on the floor, normally distributed [m]; returns them and their radius."""
    model, data = env.physics.model, env.physics.data
    count, spacing = model.numeric("water/particles").data
    count = int(count)
    points = data.plugin_state[1 : 1 + 3 * count].reshape(-1, 3)
    assert np.shares_memory(points, data.plugin_state)
    points[:, :2] = np.random.default_rng(0).normal(scale=spread, size=(count, 2))
    points[:, 2] = DROP * spacing
    return points, DROP * spacing


def _shown(camera, points, radius):
    """Pixels (height, width) whose rays hit a ball around one of the points."""
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    pixels = np.stack([columns, rows, np.ones(SIZE)], axis=-1).reshape(-1, 3)
    rays = pixels @ np.linalg.inv(camera.intrinsics).T
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    seen = points @ camera.extrinsics[:3, :3].T + camera.extrinsics[:3, 3]
    along = rays @ seen.T
    squared = (seen**2).sum(axis=1) - along**2
    return ((along > 0) & (squared < radius**2)).any(axis=1).reshape(SIZE)


def _drawn_by_opengl(env, points):
    view = LabeledView("task", *SIZE, lambda: env.task.scene.segmentation_models)
    return view.labels(env.physics)


def _drawn_in_a_batch(env, points):
    device = CpuDevice()
    pictures = Pictures(1, len(points), 0, 1, SIZE, device)
    scene = describe(env.physics.model.ptr, ["task"], {}, env.task.scene.segmentation_models)
    labels, _ = pictures.surfaces(
        np.array([pictures.load(scene)]), points[None].copy(), np.zeros((1, 0, 7))
    )
    return labels[0, 0]


@pytest.mark.parametrize("spread", [0.3, 1.2])
def test_drops_keep_their_area(env, spread):
    """The surface of a drop is a polyhedron within the ball."""
    points, radius = _spill(env, spread)
    camera = LabeledView("task", *SIZE, dict).calibration(env.physics)
    shown = _shown(camera, points, radius)
    for drawn in (_drawn_by_opengl, _drawn_in_a_batch):
        found = drawn(env, points)
        expected = shown & (found != LABELS.index("container"))
        assert 0.1 < expected.mean() < 0.5, drawn
        assert 0.45 < (found == OBJECT).sum() / expected.sum() < 0.9, drawn


@pytest.mark.long
def test_spilling_water_ends_no_episode():
    """The cup is thrown about: from env step 66 on 6,000 triangles were not enough."""
    env = softgym_mj.load("transport_water", split="all", observation="rgb", image_size=(32, 32))
    env.reset(3)
    rng, shape = np.random.default_rng(1), env.action_spec().shape
    first = None
    for _ in range(75):
        step = env.step(rng.choice([-1.0, 1.0], shape))
        first = step.observation["rgb"] if first is None else first
    assert step.last() and np.abs(step.observation["rgb"].astype(int) - first).mean() > 1.0
