"""Meshes and heightfields of `ClothBatchSolver`, whose oracle is the plugin: the same bits."""

import numpy as np
import pytest

from softgym_mj.batch.device import CpuDevice
from softgym_mj.batch.gpu import GRIDS, SOLIDS
from softgym_mj.cloth.batch_solver import ClothBatchSolver, describe
from softgym_mj.exceptions import InvalidArgumentError
from tests.cloth.flex_scene import WOVEN, rope, sheet, straight
from tests.cloth.pushed import NO_GRIPPERS, Pushed, body
from tests.scenes import solid_meshes

FLEXES = {
    "cloth": sheet(12, 12, center=(0.01, 0.0, 0.24), fabric=WOVEN),
    "rope": rope(straight(31, 0.0125, (-0.19, 0.01, 0.24))),
}
MESH = 'type="mesh" mesh="bunny"'
BUNNY = solid_meshes.mesh_asset(*solid_meshes.bunny(), name="bunny")
HEIGHTS = solid_meshes.heights_asset(np.random.default_rng(0).random((9, 11)), 0.2, 0.05)
# Static solids: each kind alone, and both among others, with one mesh twice.
SCENES = {
    "mesh": f'<geom name="bunny" {MESH} pos="0 0 .05"/>',
    "field": '<geom name="field" type="hfield" hfield="solid" pos="0 0 .17" quat="8 0 1 2"/>',
    "ball": '<geom name="ball" type="sphere" size=".1"/>',
    "several": f"""<geom name="low" {MESH} pos="-.1 0 .06"/>
        <geom name="ball" type="sphere" size=".05" pos=".01 .01 .17"/>
        <geom name="field" type="hfield" hfield="solid" pos="0 0 .1"/>
        <body pos=".12 0 .05" euler="0 0 170"><geom name="high" {MESH}/></body>""",
}


def scene(flex: str, ground: str, **settings) -> Pushed:
    """A flex that falls on static solids."""
    names = [part.split('"')[0] for part in SCENES[ground].split('geom name="')[1:]]
    return Pushed(FLEXES[flex], SCENES[ground], solids=names, extra=BUNNY + HEIGHTS, **settings)


class Counting(CpuDevice):
    """Counts the bytes that it has, and notes the kernel of the last step."""

    size, variant = 0, ""

    def step(self, kind, batch, num_slots, size, variant=""):
        super().step(kind, batch, num_slots, size, variant)
        self.variant = variant

    def zeros(self, shape, dtype):
        array = super().zeros(shape, dtype)
        self.size += array.nbytes
        return array


def step_and_check(pushed: Pushed, number: int, device: CpuDevice | None = None) -> np.ndarray:
    """Makes steps like the plugin's; returns how much each solid is pushed."""
    solver, forces = pushed.solver(device), np.zeros((len(pushed.solids), 3))
    for _ in range(number):
        solver.step(*NO_GRIPPERS, pushed.push({}))
        pushed.check(solver)
        own = pushed.forces()
        np.testing.assert_allclose(solver.solid_forces[0, :, :3], own, rtol=0.0, atol=1e-12)
        forces += abs(own)
    assert solver.flags[0] == 0
    return forces.max(axis=1)


@pytest.mark.parametrize("flex", FLEXES)
@pytest.mark.parametrize("ground", SCENES)
def test_static_grids_push_as_in_the_plugin(flex, ground):
    assert step_and_check(scene(flex, ground), 60).min() > 0.0


@pytest.mark.parametrize("turns", [1, 5])
def test_no_bit_depends_on_the_order_of_what_is_done_at_once(turns):
    assert step_and_check(scene("cloth", "several"), 40, CpuDevice(turns=turns)).min() > 0.0


@pytest.mark.parametrize("flex", FLEXES)
@pytest.mark.parametrize("mass", [2000.0, 0.5])
def test_meshes_that_move_push_and_are_pushed_as_in_the_plugin(flex, mass):
    moving = body("a", (0.0, 0.0, 0.06), mass, f'name="a" {MESH}', turn=(0.9, 0.1, 0.3, 0.3))
    pushed = Pushed(FLEXES[flex], moving, solids="a", extra=BUNNY)
    solver, pushes = pushed.solver(), 0
    for i in range(40):
        motion = pushed.push({"a": (0.1, 0.0, 0.1, 0.5, 0.3, 1.0)} if i < 20 else {})
        solver.step(*NO_GRIPPERS, motion)
        pushed.check(solver)
        pushed.bodies.check(solver, motion)
        pushes += solver.solid_forces.any()
    assert pushes > 10
    assert solver.flags[0] == 0


def memory_of(ground: str, num_envs: int) -> int:
    """Bytes of a batch whose environments have frictions of their own."""
    device, pushed = Counting(), scene("rope", ground)
    solver = ClothBatchSolver(num_envs, pushed.model.nflexvert, 0, device, len(pushed.solids), 0)
    for i in range(num_envs):
        pushed.model.geom_friction[pushed.solids, 0] = 2.0 + i
        solver.start(i, describe(pushed.model, [], solids=pushed.solids))
    assert len(set(solver.models.tolist())) == num_envs
    return device.size


@pytest.mark.parametrize(("ground", "least", "most"), [("mesh", 1e6, 2**23), ("field", 396, 396)])
def test_environments_share_one_copy_of_a_grid(ground, least, most):
    """It is all that a mesh or heightfield needs more than a sphere: 9 x 11 floats, or 4 a node."""
    alone, five = (memory_of(ground, number) - memory_of("ball", number) for number in (1, 5))
    assert least <= alone == five <= most


def test_the_kernel_with_grids_is_used_from_the_first_one_on():
    """A CUDA graph of the other kernel counts as outdated."""
    device, scenes = Counting(), {name: scene("rope", name) for name in ("ball", "mesh")}
    solver, found = scenes["ball"].solver(device), []
    for name in ("ball", "mesh", "ball"):
        solver.start(0, describe(scenes[name].model, [], solids=scenes[name].solids))
        solver.step(*NO_GRIPPERS, scenes[name].push({}))
        found.append((device.variant, solver.grown))
    (first, before), *others = found
    assert first == SOLIDS
    assert others == [(GRIDS, others[0][1])] * 2
    assert others[0][1] > before


def test_grids_that_do_not_fit_are_refused():
    pushed = scene("rope", "mesh")
    pushed.model.geom_contype[pushed.solids] = pushed.model.geom_conaffinity[pushed.solids] = 0
    with pytest.raises(InvalidArgumentError, match="meshes and heightfields that may touch"):
        describe(pushed.model, [], solids=pushed.solids)
