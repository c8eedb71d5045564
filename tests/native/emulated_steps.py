"""Makes steps of a task's environments, and draws them, by a library in place of the package's.

python -m tests.native.emulated_steps LIBRARY TASK VARIATION STEPS

TASK "arms" stands for an arm whose pads push a cloth, "cloth" and "rope" for one on a mesh, a
heightfield and others.
"""

import ctypes
import itertools
import sys

import numpy as np

import softgym_mj
from softgym_mj.batch.device import CpuDevice
from softgym_mj.rendering.batch import Pictures, describe
from tests.cloth import test_batch_arms as arms
from tests.cloth import test_batch_grids as grids
from tests.cloth import test_batch_solver as cloth
from tests.cloth.pushed import NO_GRIPPERS
from tests.fluid import test_batch_solver as water

THREADS = 16  # Threads of a block: two groups of eight lanes.
SIDES = 16, 12  # Size of an image [pixels].


class _Emulated(CpuDevice):
    """Steps by the functions of a library, of the names of those of the package's."""

    def __init__(self, file, threads=THREADS):
        super().__init__()
        self._library, self._block = ctypes.CDLL(str(file)), threads

    def max_slots(self, kind, size):
        return 2  # Each half of a block steps an environment.

    def step(self, kind, batch, num_envs, size, variant=""):
        step = getattr(self._library, f"softgym_mj_{kind}_batch_step")
        step(ctypes.c_void_p(self.address(batch)), 1, self._block)


def step_and_check(file, task, variation, steps):
    """Makes some sim steps from a variation's start; each ends like the plugin's."""
    device = _Emulated(file)
    if "water" in task:
        task, _, actor = task.partition("/")
        followed = water._Followed(task, variation, **({"actor": actor} if actor else {}))
        solver = water._solver([followed], device)
        told = followed.steps(1)
    else:
        followed = cloth._Followed(task, variation, fidelity="fast")
        solver = cloth._solver([cloth._model(followed.env)], device)
        followed.place(solver, 0)
        told = followed.steps(followed.actions(1, 0))
    for arrays in itertools.islice(told, steps):
        solver.step(*(array[None] for array in arrays))
        followed.check(solver, 0)
    assert solver.flags[0] == 0


def halves_and_check(file, task, variations, steps):
    """Makes sim steps of several environments by a block, which halves of it share."""
    followed = [water._Followed(task, variation) for variation in variations]
    solver = water._solver(followed, _Emulated(file, 2 * THREADS))
    for told in itertools.islice(zip(*(each.steps(1) for each in followed), strict=True), steps):
        water._step(solver, *told)
        for i, each in enumerate(followed):
            each.check(solver, i)
    assert not solver.flags.any()


def push_and_check(file, steps, threads=THREADS):
    """Makes some sim steps from the first push of an arm's hand on; as the package's library."""
    followed = arms._Followed("fold_crumpled_cloth", "sawyer", "friction", 803)
    solver, emulated, number = followed.solver, followed.new(_Emulated(file, threads)), 0
    state = solver.get_state(0)
    for told in followed.steps(6):
        if solver.solid_impulses.any():
            emulated.set_state(0, state)
            emulated.step(*told)
            for name, array in solver.get_state(0).items():
                np.testing.assert_array_equal(emulated.get_state(0)[name], array, err_msg=name)
            np.testing.assert_array_equal(emulated.solid_impulses, solver.solid_impulses)
            np.testing.assert_array_equal(emulated.solid_forces, solver.solid_forces)
            number += 1
        if number == steps:
            return
        state = solver.get_state(0)
    raise AssertionError(f"{number} pushes")


def lie_and_check(file, flex, steps):
    """Makes the last of 30 sim steps of a flex on a mesh and a heightfield."""
    pushed = grids.scene(flex, "several")
    solver, emulated = pushed.solver(), pushed.solver(_Emulated(file))
    for i in range(30):
        if i == 30 - steps:
            emulated.set_state(0, solver.get_state(0))
        motion = pushed.push({})
        solver.step(*NO_GRIPPERS, motion)
        if i >= 30 - steps:
            emulated.step(*NO_GRIPPERS, motion)
            pushed.check(emulated)
            assert emulated.solid_forces.any(axis=(0, 2)).all()
    assert emulated.flags[0] == 0


def draw_and_check(file, task, variation):
    """Draws a variation's start; the picture is that of the package's program."""
    env = softgym_mj.load(task, split="all", fidelity="fast")
    env.reset(variation)
    points = next(iter(env.task.scene.points().values()))[None]
    described = describe(env.physics.model.ptr, ["task"], {}, env.task.scene.segmentation_models)
    found = []
    for device in (CpuDevice(), _Emulated(file)):
        pictures = Pictures(1, points.shape[1], 0, 1, SIDES, device)
        told = np.array([pictures.load(described)]), points, np.zeros((1, 0, 7))
        found.append([pictures.colors(*told), *pictures.surfaces(*told)])
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one, other)


if __name__ == "__main__":
    library, name, index, number = sys.argv[1:]
    if name == "arms":
        push_and_check(library, int(number))
    elif name in grids.FLEXES:
        lie_and_check(library, name, int(number))
    else:
        step_and_check(library, name, int(index), int(number))
        draw_and_check(library, name.partition("/")[0], int(index))
