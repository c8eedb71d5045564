"""`ClothBatchSolver`, whose oracle is the plugin: the same bits."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.batch.device import CpuDevice
from softgym_mj.cloth.batch_solver import CANDIDATES_FULL, NOT_FINITE, ClothBatchSolver, describe
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError

# Task, variation, env steps.
EPISODES = (
    ("straighten_rope", 805, 20),
    ("rope_configuration", 806, 20),
    ("fold_cloth", 806, 12),
    ("spread_cloth", 803, 8),
    ("fold_crumpled_cloth", 815, 6),
    ("drop_cloth", 811, 8),
    ("drop_fold_cloth", 812, 8),
)


class _Spoilt(ClothBatchSolver):
    """Finds what is left in its memory by the steps of any environment, or anything."""

    def _step(self, **told):
        self._memory[...] = 255  # Not a number, and no index.
        super()._step(**told)


def _solver(models, device=None):
    """ClothBatchSolver of these models."""
    most = 600  # Vertices of the largest one.
    solver = _Spoilt(len(models), most, 2, device)
    for i, model in enumerate(models):
        solver.start(i, model)
    return solver


def _model(env, room=1.0):
    model = env.physics.model.ptr
    geoms = [model.geom(f"picker/picker_{i}").id for i in range(env.task.actor.num_grippers)]
    return describe(model, geoms, room)


class _Followed:
    """An environment with pickers, and the inputs by which a `ClothBatchSolver` repeats it."""

    def __init__(self, task, variation, **settings):
        self.env = softgym_mj.load(task, split="all", **settings)
        self.env.reset(variation)
        self.flex, self.actor = self.env.task.flexes.flexes[0], self.env.task.actor

    def place(self, solver, i):
        """Copies the environment's state to row `i` of the batch."""
        count = self.flex.num_points
        solver.qpos[i, :count] = self.flex.slides
        solver.qvel[i, :count] = self.flex.slide_velocities
        solver.gripper_qpos[i] = self.actor.slides
        solver.valid[i] = 0

    def steps(self, actions):
        """Plays env steps; at the end of each physics step, yields the inputs of a batch step."""
        task, physics = self.env.task, self.env.physics
        for action in actions:
            task.before_step(physics, action, None)
            for _ in range(task.action_repeat):
                task.before_substep(physics, action, None)
                goals = np.nan_to_num(self.actor.held_positions())
                told = self.actor.positions(), self.actor.held, goals
                physics.step()
                yield told
            task.after_step(physics, None)

    def check(self, solver, i):
        """Checks that row `i` of the batch equals the environment bit by bit."""
        count = self.flex.num_points
        np.testing.assert_array_equal(solver.qpos[i, :count], self.flex.slides)
        np.testing.assert_array_equal(solver.qvel[i, :count], self.flex.slide_velocities)
        np.testing.assert_array_equal(solver.gripper_qpos[i], self.actor.slides)
        for vertex in self.actor.held[self.actor.held >= 0]:
            force = self.flex.holding_force(vertex)
            assert solver.holding_force[i, vertex] == force

    def actions(self, number, seed):
        """Random ones with the grips mostly on."""
        shape = (number, *self.env.action_spec().shape)
        actions = np.random.default_rng(seed).uniform(-1.0, 1.0, shape)
        actions[:, 3::4] += 0.7
        return actions.clip(-1.0, 1.0)


def _play_and_check(followed, solver, number):
    """Plays env steps in all environments and the batch, which end each physics step alike."""
    rounds = zip(*(f.steps(f.actions(number, i)) for i, f in enumerate(followed)), strict=True)
    for told in rounds:
        solver.step(*(np.stack(arrays) for arrays in zip(*told, strict=True)))
        for i, each in enumerate(followed):
            each.check(solver, i)


@pytest.mark.parametrize(
    ("domain", "parameter"), [("fabrics", "bend_weft"), ({"stiffening": 60.0}, "stiffening")]
)
def test_an_environment_bends_plates_and_stiffens_as_the_plugin_does(domain, parameter):
    followed = _Followed("spread_cloth", 803, domain=domain)
    assert followed.env.task.domain.values[parameter] > 0.0
    solver = _solver([_model(followed.env)])
    followed.place(solver, 0)
    _play_and_check([followed], solver, 4)


@pytest.mark.parametrize(("task", "variation", "number"), EPISODES)
def test_an_environment_makes_the_steps_of_the_plugin(task, variation, number):
    followed = _Followed(task, variation)
    solver = _solver([_model(followed.env)])
    followed.place(solver, 0)
    _play_and_check([followed], solver, number)
    assert solver.flags[0] == 0


@pytest.mark.parametrize("turns", [1, 2, 5])
@pytest.mark.parametrize("task", ["rope_configuration", "fold_crumpled_cloth", "drop_cloth"])
def test_no_bit_depends_on_the_order_of_what_is_done_at_once(task, turns):
    followed = _Followed(task, 806, fidelity="fast")
    solver = _solver([_model(followed.env)], CpuDevice(turns=turns))
    followed.place(solver, 0)
    _play_and_check([followed], solver, 6)


def test_environments_of_different_sizes_side_by_side():
    followed = [
        _Followed("spread_cloth", variation, fidelity="fast") for variation in (801, 803, 810)
    ]
    models = [_model(each.env) for each in followed]
    assert len({len(model) for model in models}) == 3
    solver = _solver([*models, models[0]], CpuDevice(num_threads=2))
    for i, each in enumerate([*followed, followed[0]]):
        each.place(solver, i)
    twin = _solver([models[0]])
    followed[0].place(twin, 0)
    for told in zip(*(each.steps(each.actions(3, 0)) for each in followed), strict=True):
        solver.step(*(np.stack([*arrays, arrays[0]]) for arrays in zip(*told, strict=True)))
        twin.step(*(array[None] for array in told[0]))
    for i, each in enumerate(followed):
        each.check(solver, i)
    followed[0].check(solver, 3)
    followed[0].check(twin, 0)


def _piles(number):
    """A `ClothBatchSolver` of one pile, and inputs that drop a picker's vertex on it."""
    followed = _Followed("spread_cloth", 803, fidelity="fast")
    solver = _solver([_model(followed.env)] * number)
    for i in range(number):
        followed.place(solver, i)
    return followed, solver


def test_an_environment_that_is_not_finite_or_has_no_model_changes_no_other():
    followed, solver = _piles(4)
    solver.qvel[1, 7, 2] = np.nan
    solver.models[2] = 0
    before = solver.qpos[2].copy()
    for told in followed.steps(followed.actions(2, 0)):
        solver.step(*(np.stack([array] * 4) for array in told))
    followed.check(solver, 0)
    followed.check(solver, 3)
    assert solver.flags.tolist() == [0, NOT_FINITE, 0, 0]
    np.testing.assert_array_equal(solver.qpos[2], before)  # It stands still.


@pytest.mark.parametrize("turns", [0, 3])
def test_an_environment_without_room_for_its_contacts_is_flagged(turns):
    followed = _Followed("spread_cloth", 803, fidelity="fast")
    models = [_model(followed.env), _model(followed.env, 0.01)]
    solver = _solver(models, CpuDevice(turns=turns))
    for i in range(2):
        followed.place(solver, i)
    for told in followed.steps(followed.actions(2, 0)):
        solver.step(*(np.stack([array] * 2) for array in told))
    followed.check(solver, 0)
    assert solver.flags[0] == 0
    assert solver.flags[1] & CANDIDATES_FULL
    assert not solver.flags[1] & NOT_FINITE
    assert np.isfinite(solver.qpos).all()


def test_a_state_continues_in_any_environment():
    followed, solver = _piles(1)
    other = _solver([_model(followed.env)] * 2)
    told = list(followed.steps(followed.actions(4, 0)))
    for each in told[:16]:
        solver.step(*(array[None] for array in each))
    other.set_state(1, solver.get_state(0))
    for each in told[16:]:
        solver.step(*(array[None] for array in each))
        other.step(*(np.stack([array] * 2) for array in each))
    np.testing.assert_array_equal(other.qpos[1], solver.qpos[0])
    followed.check(solver, 0)


def test_what_does_not_fit_is_refused():
    env = softgym_mj.load("transport_water", split=[800])
    with pytest.raises(InvalidArgumentError, match="no flex carries the plugin"):
        describe(env.physics.model.ptr, [])
    arm = softgym_mj.load("straighten_rope", split=[800], actor="franka")
    with pytest.raises(InvalidArgumentError, match="expected spheres as grippers"):
        describe(arm.physics.model.ptr, [1])
    rope = softgym_mj.load("straighten_rope", split=[800])
    with pytest.raises(InvalidArgumentError, match="'vertices': 41"):
        ClothBatchSolver(1, 40, 2).start(0, _model(rope))
    with pytest.raises(LifecycleError, match="no model"):
        ClothBatchSolver(1, 40, 2).get_state(0)


def test_states_do_not_depend_on_the_order_of_what_is_done_at_once():
    states = []
    for turns in (0, 3):
        followed = _Followed("spread_cloth", 803, fidelity="fast")
        solver = _solver([_model(followed.env)], CpuDevice(turns=turns))
        followed.place(solver, 0)
        for told in followed.steps(followed.actions(2, 0)):
            solver.step(*(array[None] for array in told))
        states.append(solver.get_state(0))
    assert (states[0]["after_layers"][..., 0] != 0).sum() > 5
    for name, array in states[0].items():
        np.testing.assert_array_equal(states[1][name], array, err_msg=name)
