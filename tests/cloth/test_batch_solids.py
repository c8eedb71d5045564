"""Solids of `ClothBatchSolver`, whose oracle is the plugin: the same bits."""

import mujoco
import numpy as np
import pytest

from softgym_mj.batch.device import CpuDevice
from softgym_mj.cloth.batch_solver import ClothBatchSolver, SolidMotion, describe
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.vector.batch import static_solids
from tests.cloth.flex_scene import WOVEN, rope, sheet, straight
from tests.cloth.pushed import NO_GRIPPERS, Pushed, body

# Shapes, one as large as the other.
SHAPES = {
    "box": 'type="box" size=".05 .02 .03" friction=".6" priority="1"',
    "capsule": 'type="capsule" size=".02 .05"',
    "cylinder": 'type="cylinder" size=".03 .02"',
    "ellipsoid": 'type="ellipsoid" size=".05 .03 .02"',
    "sphere": 'type="sphere" size=".03"',
}
FLEXES = {
    "cloth": sheet(9, 11, fabric=WOVEN, center=(0.0, 0.0, 0.1)),
    "rope": rope(straight(31, 0.0125, (-0.19, 0.0, 0.12))),
}
TURN = np.array([0.9, 0.1, 0.3, 0.2]) / np.sqrt(0.95)
HEAVY = 2000.0  # [kg] Flexes do not move bodies of more than 1 t.


def scene(flex: str, shape: str) -> Pushed:
    """Two bodies below a flex: one with a solid, and one with a solid beside its center of mass."""
    bodies = (
        body("a", (-0.05, 0.01, 0.06), HEAVY, f'name="a" {SHAPES[shape]}', turn=TURN),
        body("b", (0.08, 0.0, 0.05), HEAVY, f'name="b" {SHAPES[shape]}'),
    )
    return Pushed(FLEXES[flex], *bodies, solids="ab")


def pushes(number: int):
    """Velocities (6,) by body: into each other, up and down, turning."""
    for i in range(number):
        yield {
            "a": (0.3, 0.05, 0.1 * np.cos(i / 9), 0.5, 0.3, 1.5),
            "b": (-0.2, 0.1, -0.1, 0, 0, -2),
        }


@pytest.mark.parametrize("flex", FLEXES)
@pytest.mark.parametrize("shape", SHAPES)
def test_solids_push_as_in_the_plugin(flex, shape):
    pushed = scene(flex, shape)
    solver, forces, moments = pushed.solver(), np.zeros((2, 3)), np.zeros((2, 3))
    for velocities in pushes(50):
        solver.step(*NO_GRIPPERS, pushed.push(velocities))
        pushed.check(solver)
        own = pushed.forces()
        np.testing.assert_allclose(solver.solid_forces[0, :, :3], own, rtol=0.0, atol=1e-12)
        forces, moments = forces + abs(own), moments + abs(solver.solid_forces[0, :, 3:])
    assert forces.min() > 0.0
    assert moments.min() > 0.0
    assert solver.flags[0] == 0


# Static solids around a sphere on a heavy body: geoms push in the order of their ids.
STATIC = """
<geom name="low" {low} pos="-.06 .01 .05"/>
{moving}
<body pos=".05 0 .02" quat="{turn}"><geom name="high" {high} pos="0 .01 .03"/></body>
"""


@pytest.mark.parametrize("flex", FLEXES)
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("speed", [1.0, 8.0])
def test_static_solids_push_as_in_the_plugin(flex, shape, speed):
    turn = " ".join(map(str, TURN))
    moving = body("moving", (0.0, 0.0, 0.07), HEAVY, f'name="moving" {SHAPES["sphere"]}')
    scenery = STATIC.format(low=SHAPES[shape], high=SHAPES[shape], moving=moving, turn=turn)
    pushed = Pushed(FLEXES[flex], scenery, solids=["moving"])
    model, data = pushed.model, pushed.data
    low, high = (model.geom(name).id for name in ("low", "high"))
    solids = [low, pushed.solids[0], high]
    assert solids == sorted(solids)
    mujoco.mj_forward(model, data)
    still = static_solids.poses(model, data, static_solids.find(model))
    assert static_solids.find(model) == [low, high]
    solver = ClothBatchSolver(1, model.nflexvert, 0, None, 3, pushed.bodies.most_dofs)
    solver.start(0, describe(model, [], solids=solids))
    forces = np.zeros((3, 3))
    for i in range(60):
        up = 0.1 * speed * np.cos(speed * i / 9)
        motion = pushed.push({"moving": (0.1, 0.02, up, 0.5, 0.3, 1.5)})
        whole = [np.insert(part, [0, 1], 0.0, axis=1) for part in motion]
        whole[0][0, [0, 2]] = still
        whole[3] = np.ones((1, 3))
        solver.step(*NO_GRIPPERS, SolidMotion(*whole))
        pushed.check(solver)
        forces += abs(solver.solid_forces[0, :, :3])
    assert forces.max(axis=1).min() > 0.0
    assert solver.flags[0] == 0


def pad(mass: float, size: float = 1.0) -> Pushed:
    """A turned box over a flat cloth, as thin as a hand's pad if `size` is 1."""
    half = " ".join(str(size * x) for x in (0.01, 0.004, 0.01))
    geom = f'name="a" type="box" size="{half}"'
    flat = sheet(9, 11, fabric=WOVEN)
    return Pushed(flat, body("a", (0.0, 0.01, 0.03), mass, geom, turn=TURN), solids="a")


@pytest.mark.parametrize("mass", [20.0, 0.3])
@pytest.mark.parametrize("size", [1.0, 5.0])
def test_bodies_that_give_way_push_and_are_pushed_as_in_the_plugin(mass, size):
    pushed = pad(mass, size)
    solver, pushes, faces = pushed.solver(), 0, 0
    for _ in range(50):
        motion = pushed.push({"a": (0.05, 0.0, -0.1, 0.0, 0.0, 0.0)})
        solver.step(*NO_GRIPPERS, motion)
        pushed.check(solver)
        pushed.bodies.check(solver, motion)
        own = pushed.forces()
        np.testing.assert_allclose(solver.solid_forces[0, :, :3], own, rtol=0.0, atol=1e-12)
        pushes, faces = pushes + solver.solid_impulses.any(), faces + solver.sides.any()
    assert pushes > 20
    assert (faces > 5) == (size == 1.0)
    assert solver.flags[0] == 0


def test_a_state_with_solids_continues_in_any_environment():
    pushed, twin = pad(0.3), pad(0.3).solver()
    solver = pushed.solver()
    for i in range(40):
        if i == 30:
            assert solver.sides.any()
            twin.set_state(0, solver.get_state(0))
        motion = pushed.push({"a": (0.05, 0.0, -0.1, 0.0, 0.0, 0.0)})
        solver.step(*NO_GRIPPERS, motion)
        twin.step(*NO_GRIPPERS, motion)
    np.testing.assert_array_equal(twin.qpos, solver.qpos)
    pushed.check(twin)


def test_a_solid_beside_the_center_of_mass_pushes_as_in_the_plugin():
    geoms = (
        f'name="a" {SHAPES["box"]} pos=".03 0 0"',
        f'name="b" {SHAPES["sphere"]} pos="-.06 .01 .02"',
    )
    pushed = Pushed(FLEXES["cloth"], body("a", (0, 0, 0.05), HEAVY, *geoms, turn=TURN), solids="ab")
    solver = pushed.solver()
    for velocities in pushes(25):
        solver.step(*NO_GRIPPERS, pushed.push({"a": velocities["a"]}))
    moved = pushed.data.qpos[: solver.qpos.size]
    assert abs(moved).max() > 0.02
    # The plugin reads centers of mass, of which the batch computes the last digit otherwise.
    np.testing.assert_allclose(solver.qpos.ravel(), moved, rtol=0.0, atol=1e-6)


def test_solids_that_do_not_touch_pass_through():
    pushed = scene("cloth", "box")
    solver = pushed.solver()
    for i, velocities in enumerate(pushes(40)):
        touching = i < 25, i > 15
        pushed.model.geom_contype[pushed.solids] = pushed.model.geom_conaffinity[pushed.solids] = (
            touching
        )
        solver.step(*NO_GRIPPERS, pushed.push(velocities))
        pushed.check(solver)


@pytest.mark.parametrize("turns", [1, 2, 5])
def test_no_bit_depends_on_the_order_of_what_is_done_at_once(turns):
    pushed = scene("cloth", "capsule")
    solver = pushed.solver(CpuDevice(turns=turns))
    for velocities in pushes(25):
        solver.step(*NO_GRIPPERS, pushed.push(velocities))
        pushed.check(solver)


def test_solids_that_do_not_fit_are_refused():
    pushed = scene("cloth", "box")
    for solids, message in ((pushed.solids[::-1], "in the order"), ([0], "expected spheres, ")):
        with pytest.raises(InvalidArgumentError, match=message):
            describe(pushed.model, [], solids=solids)
    with pytest.raises(InvalidArgumentError, match="motion"):
        pushed.solver().step(*NO_GRIPPERS)
    with pytest.raises(InvalidArgumentError, match="'solids': 1"):
        pushed.solver().load(describe(pushed.model, [], solids=pushed.solids[:1]))
