"""Twist of ropes: errors, state, and the batch, whose oracle is the plugin."""

import mujoco
import numpy as np
import pytest

from softgym_mj.batch.device import CpuDevice
from softgym_mj.cloth.batch_solver import ClothBatchSolver, describe
from softgym_mj.exceptions import InvalidArgumentError
from tests.cloth.flex_scene import TIMESTEP, FlexScene, rope, straight
from tests.cloth.twisted import BEND, TWIST, angle_of, wavy


def test_branches_and_sheets_do_not_twist():
    points = straight(4, 0.02)
    points[3] = [0.02, 0.02, 0.0]
    flex = rope(points, twist=TWIST)
    flex.elements = np.array([[0, 1], [1, 2], [1, 3]])
    with pytest.raises(ValueError, match="without branches"):
        FlexScene(flex)


def test_a_rope_without_twist_has_no_angle():
    scene = FlexScene(rope(straight(4, 0.02)))
    with pytest.raises(InvalidArgumentError, match="twist"):
        angle_of(scene)


def test_the_angle_is_part_of_the_state():
    def build() -> FlexScene:
        scene = FlexScene(rope(wavy(), twist=TWIST, radius=1e-3), floor=False)
        scene.hold(0, 11)
        return scene

    scene, other = build(), build()
    angle_of(scene)[0] = 4.0
    scene.step(20)
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(scene.model, kind))
    mujoco.mj_getState(scene.model, scene.data, state, kind)
    mujoco.mj_setState(other.model, other.data, state, kind)
    mujoco.mj_forward(other.model, other.data)
    for each in (scene, other):
        for _ in range(10):
            each.data.qvel[each.dofs[[0, 11]]] = 0.0
            mujoco.mj_step(each.model, each.data)
    np.testing.assert_array_equal(other.data.qpos, scene.data.qpos)
    assert angle_of(other)[0] == angle_of(scene)[0] != 4.0


@pytest.mark.parametrize("turns", [0, 1, 5])
def test_a_batch_twists_as_the_plugin_does(turns):
    slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in ("1 0 0", "0 1 0", "0 0 1"))
    pickers = "".join(
        f'<body pos="{x} 0 0.05">{slides}<geom name="p{i}" type="sphere" size=".005"/></body>'
        for i, x in enumerate((-0.5, 0.7))
    )
    flex = rope(straight(21, 0.0125, (0.0, 0.0, 0.1)), twist=3e-4, bend=BEND, radius=3e-3)
    scene = FlexScene(flex, scenery=pickers)
    geoms = [scene.model.geom(f"p{i}").id for i in range(2)]
    batch = ClothBatchSolver(1, 21, 2, CpuDevice(turns=turns))
    batch.start(0, describe(scene.model, geoms))
    scene.hold(0, 20)
    angle_of(scene)[0] = batch.twist[0, 0] = 9.0
    bodies = scene.model.flex_vertbodyid
    origin, ends = scene.model.body_pos[bodies], [0, 20]
    for step in range(60):
        move = np.array([[0.0, 0.0, 0.0], [-0.2, 0.02 * (step % 7), 0.0]])
        slides = scene.data.qpos[scene.dofs]
        goals = (origin + slides)[ends] + TIMESTEP * move
        batch.step(np.zeros((1, 2, 3)), np.array([ends]), goals[None])
        scene.data.qvel[scene.dofs[ends]] = (goals - origin[ends] - slides[ends]) / TIMESTEP
        scene.data.qvel[-6:] = 0.0
        mujoco.mj_step(scene.model, scene.data)
    assert abs(angle_of(scene)[0] - 9.0) > 0.1
    np.testing.assert_array_equal(batch.qpos[0], scene.data.qpos[scene.dofs])
    np.testing.assert_array_equal(batch.twist[0], angle_of(scene))
