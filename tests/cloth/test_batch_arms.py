"""Hands of arms that push a flex, in `ClothBatchSolver`: the bits of the environments."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.batch.device import CpuDevice, Device
from softgym_mj.cloth import solver
from softgym_mj.cloth.batch_solver import ClothBatchSolver, describe
from softgym_mj.vector.batch import static_solids
from tests.cloth.pushed import Bodies

HAND = "hand_collision", "gripper_base_collision", "left_pad", "right_pad"
# Task, arm, variation, env steps, order of iterations.
EPISODES = (
    ("fold_cloth", "franka", 803, 5, 0),
    ("straighten_rope", "franka", 803, 8, 0),
    ("fold_crumpled_cloth", "sawyer", 803, 6, 0),
    ("spread_cloth", "ur5e", 803, 5, 3),
    ("route_cable", "franka", 803, 8, 1),
)


class _Followed:
    """An environment with arms, and a batch that follows it."""

    def __init__(
        self, task: str, actor: str, grasp: str, variation: int, device: Device | None = None
    ):
        self.env = softgym_mj.load(task, split=[variation], actor=actor, grasp=grasp)
        self.env.reset(variation)
        self.flex, self.actor = self.env.task.flexes.flexes[0], self.env.task.actor
        model, data = self.env.physics.model.ptr, self.env.physics.data.ptr
        names = [model.geom(i).name.split("/")[-1] for i in range(model.ngeom)]
        hands = [i for i, name in enumerate(names) if name in HAND]
        solids = sorted([*static_solids.find(model), *hands])
        self.bodies = Bodies(model, data, solids)
        self._described = describe(model, [-1, -1], solids=solids)
        self.solver = self.new(device)
        count = self.flex.num_points
        self.solver.qpos[0, :count] = self.flex.slides
        self.solver.qvel[0, :count] = self.flex.slide_velocities
        data.plugin_state[model.plugin_stateadr[0]] = 0.0

    def new(self, device: Device | None) -> ClothBatchSolver:
        """A batch for this environment on a device."""
        solids, dofs = len(self.bodies.solids), self.bodies.most_dofs
        more = self.flex.num_points + 3  # Rows have room for larger models.
        batch = ClothBatchSolver(1, more, 2, device, solids, dofs, notes_pushes=True)
        batch.start(0, self._described)
        return batch

    def pushes(self) -> np.ndarray:
        """Least components of contact normals along the y axes of solids (solids, vertices)."""
        model, data = self.bodies.model, self.bodies.data
        found = np.zeros((len(self.bodies.solids), model.nflexvert + 1))
        contacts = solver.contacts(model, data)
        for contact in contacts:
            k = self.bodies.solids.index(contact["geom"])
            along = contact["normal"] @ data.geom_xmat[contact["geom"]].reshape(3, 3)[:, 1]
            own = np.clip(contact["vertex"], -1, model.nflexvert)  # Others are no vertices.
            found[k, own] = np.minimum(found[k, own], along)
        return found[:, :-1]

    def steps(self, number: int):
        """Plays random env steps that lower the hands; yields the motion of each physics step."""
        task, physics = self.env.task, self.env.physics
        random, timestep = np.random.default_rng(1), physics.model.opt.timestep
        holds = self.bodies.model.dof_M0  # Raised for vertices that are attached.
        for _ in range(number):
            action = random.uniform(-1.0, 1.0, self.env.action_spec().shape)
            action = np.clip(action + np.tile([0.0, 0.0, -0.6, 0.5], 2), -1.0, 1.0)
            task.before_step(physics, action, None)
            for _ in range(task.action_repeat):
                task.before_substep(physics, action, None)
                held = np.where(holds[3 * self.actor.held] > 1.0, self.actor.held, -1)
                ends = self.flex.origin + self.flex.slides + timestep * self.flex.slide_velocities
                motion = self.bodies.follow(physics.step)
                told = np.zeros((1, 2, 3)), held[None], ends[held][None], motion
                self.solver.step(*told)
                yield told
            task.after_step(physics, None)


@pytest.mark.parametrize(("task", "actor", "variation", "number", "turns"), EPISODES)
def test_hands_push_and_hold_as_in_the_plugin(task, actor, variation, number, turns):
    followed = _Followed(task, actor, "friction", variation, CpuDevice(turns=turns))
    batch, pushes, faces = followed.solver, 0, 0
    for *_, motion in followed.steps(number):
        count = followed.flex.num_points
        np.testing.assert_array_equal(batch.qpos[0, :count], followed.flex.slides)
        np.testing.assert_array_equal(batch.qvel[0, :count], followed.flex.slide_velocities)
        np.testing.assert_allclose(batch.pushes[0, :, :count], followed.pushes(), atol=1e-7)
        followed.bodies.check(batch, motion)
        pushes += batch.solid_impulses.any()
        faces += batch.sides.any()
    assert pushes > 1
    assert faces > 1 or "cloth" not in task
    assert batch.flags[0] == 0


def test_hands_hold_attached_vertices():
    followed = _Followed("fold_cloth", "franka", "attach", 803)
    number = 0
    for _, held, _, _ in followed.steps(4):
        number += (held >= 0).sum()
        # The goal of a held vertex is rounded otherwise.
        slides = followed.flex.slides
        np.testing.assert_allclose(
            followed.solver.qpos[0, : len(slides)], slides, rtol=0.0, atol=1e-7
        )
    assert number > 5
