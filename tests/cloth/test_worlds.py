"""`ClothWorlds`, whose oracle is the plugin: the same bits."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.batch.places import Processor
from softgym_mj.cloth.worlds import CANDIDATES_FULL, NOT_FINITE, ClothWorlds, describe
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


class _Spoilt(ClothWorlds):
    """Finds what is left in its memory by the steps of any world, or anything."""

    def _step(self, **told):
        self._memory[...] = 255  # Not a number, and no index.
        super()._step(**told)


def _worlds(models, place=None):
    """ClothWorlds of these models."""
    most = 600  # Vertices of the largest one.
    worlds = _Spoilt(len(models), most, 2, place)
    for i, model in enumerate(models):
        worlds.start(i, model)
    return worlds


def _model(env, room=1.0):
    model = env.physics.model.ptr
    geoms = [model.geom(f"picker/picker_{i}").id for i in range(env.task.actor.num_grippers)]
    return describe(model, geoms, room)


class _Followed:
    """An environment with pickers, and what `ClothWorlds` are told to do the same."""

    def __init__(self, task, variation, **settings):
        self.env = softgym_mj.load(task, split="all", **settings)
        self.env.reset(variation)
        self.flex, self.actor = self.env.task.flexes.flexes[0], self.env.task.actor

    def place(self, worlds, i):
        """Puts world `i` where the environment is."""
        count = self.flex.num_points
        worlds.qpos[i, :count], worlds.qvel[i, :count] = (
            self.flex.slides,
            self.flex.slide_velocities,
        )
        worlds.gripper_qpos[i] = self.actor.slides
        worlds.valid[i] = 0

    def steps(self, actions):
        """Plays env steps; at the end of each physics step, yields what a world is told of it."""
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

    def check(self, worlds, i):
        """That world `i` is where the environment is, bit by bit."""
        count = self.flex.num_points
        np.testing.assert_array_equal(worlds.qpos[i, :count], self.flex.slides)
        np.testing.assert_array_equal(worlds.qvel[i, :count], self.flex.slide_velocities)
        np.testing.assert_array_equal(worlds.gripper_qpos[i], self.actor.slides)
        for vertex in self.actor.held[self.actor.held >= 0]:
            force = self.flex.holding_force(vertex)
            assert worlds.holding_force[i, vertex] == force

    def actions(self, number, seed):
        """Random ones with the grips mostly on."""
        shape = (number, *self.env.action_spec().shape)
        actions = np.random.default_rng(seed).uniform(-1.0, 1.0, shape)
        actions[:, 3::4] += 0.7
        return actions.clip(-1.0, 1.0)


def _play_and_check(followed, worlds, number, seed=0):
    """Plays env steps in all environments and worlds, which end each physics step alike."""
    rounds = zip(
        *(f.steps(f.actions(number, seed + i)) for i, f in enumerate(followed)), strict=True
    )
    for told in rounds:
        worlds.step(*(np.stack(arrays) for arrays in zip(*told, strict=True)))
        for i, each in enumerate(followed):
            each.check(worlds, i)


def test_a_world_bends_a_plate_as_the_plugin_does():
    followed = _Followed("spread_cloth", 803, domain="fabrics")
    assert followed.env.task.domain.values["bend_weft"] > 0.0
    worlds = _worlds([_model(followed.env)])
    followed.place(worlds, 0)
    _play_and_check([followed], worlds, 4)


@pytest.mark.parametrize(("task", "variation", "number"), EPISODES)
def test_a_world_makes_the_steps_of_the_plugin(task, variation, number):
    followed = _Followed(task, variation)
    worlds = _worlds([_model(followed.env)])
    followed.place(worlds, 0)
    _play_and_check([followed], worlds, number)
    assert worlds.flags[0] == 0


@pytest.mark.parametrize("turns", [1, 2, 5])
@pytest.mark.parametrize("task", ["rope_configuration", "fold_crumpled_cloth", "drop_cloth"])
def test_no_bit_depends_on_the_order_of_what_is_done_at_once(task, turns):
    followed = _Followed(task, 806, fidelity="fast")
    worlds = _worlds([_model(followed.env)], Processor(turns=turns))
    followed.place(worlds, 0)
    _play_and_check([followed], worlds, 6)


def test_worlds_of_different_sizes_side_by_side():
    followed = [
        _Followed("spread_cloth", variation, fidelity="fast") for variation in (801, 803, 810)
    ]
    models = [_model(each.env) for each in followed]
    assert len({len(model) for model in models}) == 3
    worlds = _worlds([*models, models[0]], Processor(num_threads=2))
    for i, each in enumerate([*followed, followed[0]]):
        each.place(worlds, i)
    twin = _worlds([models[0]])
    followed[0].place(twin, 0)
    for told in zip(*(each.steps(each.actions(3, 0)) for each in followed), strict=True):
        worlds.step(*(np.stack([*arrays, arrays[0]]) for arrays in zip(*told, strict=True)))
        twin.step(*(array[None] for array in told[0]))
    for i, each in enumerate(followed):
        each.check(worlds, i)
    followed[0].check(worlds, 3)
    followed[0].check(twin, 0)


def _heaps(number, room=1.0):
    """ClothWorlds with the same heap, and what they are told to drop a picker's vertex on it."""
    followed = _Followed("spread_cloth", 803, fidelity="fast")
    worlds = _worlds([_model(followed.env, room)] * number)
    for i in range(number):
        followed.place(worlds, i)
    return followed, worlds


def test_a_world_that_is_not_finite_changes_no_other():
    followed, worlds = _heaps(3)
    worlds.qvel[1, 7, 2] = np.nan
    for told in followed.steps(followed.actions(2, 0)):
        worlds.step(*(np.stack([array] * 3) for array in told))
    followed.check(worlds, 0)
    followed.check(worlds, 2)
    assert worlds.flags.tolist() == [0, NOT_FINITE, 0]


@pytest.mark.parametrize("turns", [0, 3])
def test_a_world_without_room_for_its_contacts_is_flagged(turns):
    followed = _Followed("spread_cloth", 803, fidelity="fast")
    models = [_model(followed.env), _model(followed.env, 0.01)]
    worlds = _worlds(models, Processor(turns=turns))
    for i in range(2):
        followed.place(worlds, i)
    for told in followed.steps(followed.actions(2, 0)):
        worlds.step(*(np.stack([array] * 2) for array in told))
    followed.check(worlds, 0)
    assert worlds.flags[0] == 0
    assert worlds.flags[1] & CANDIDATES_FULL
    assert not worlds.flags[1] & NOT_FINITE
    assert np.isfinite(worlds.qpos).all()


def test_a_state_continues_in_any_world():
    followed, worlds = _heaps(1)
    other = _worlds([_model(followed.env)] * 2)
    told = list(followed.steps(followed.actions(4, 0)))
    for each in told[:16]:
        worlds.step(*(array[None] for array in each))
    other.set_state(1, worlds.get_state(0))
    for each in told[16:]:
        worlds.step(*(array[None] for array in each))
        other.step(*(np.stack([array] * 2) for array in each))
    np.testing.assert_array_equal(other.qpos[1], worlds.qpos[0])
    followed.check(worlds, 0)


def test_what_does_not_fit_is_refused():
    env = softgym_mj.load("transport_water", split=[800])
    with pytest.raises(InvalidArgumentError, match="no flex carries the plugin"):
        describe(env.physics.model.ptr, [])
    arm = softgym_mj.load("straighten_rope", split=[800], actor="franka")
    with pytest.raises(InvalidArgumentError, match="expected spheres as grippers"):
        describe(arm.physics.model.ptr, [1])
    rope = softgym_mj.load("straighten_rope", split=[800])
    with pytest.raises(InvalidArgumentError, match="'vertices': 41"):
        ClothWorlds(1, 40, 2).start(0, _model(rope))
    with pytest.raises(LifecycleError, match="no model"):
        ClothWorlds(1, 40, 2).get_state(0)


def test_a_world_without_a_model_stands_still():
    followed, worlds = _heaps(3)
    worlds.models[1] = 0
    before = worlds.qpos[1].copy()
    for told in followed.steps(followed.actions(1, 0)):
        worlds.step(*(np.stack([array] * 3) for array in told))
    np.testing.assert_array_equal(worlds.qpos[1], before)
    followed.check(worlds, 2)


def test_states_do_not_depend_on_the_order_of_what_is_done_at_once():
    states = []
    for turns in (0, 3):
        followed = _Followed("spread_cloth", 803, fidelity="fast")
        worlds = _worlds([_model(followed.env)], Processor(turns=turns))
        followed.place(worlds, 0)
        for told in followed.steps(followed.actions(2, 0)):
            worlds.step(*(array[None] for array in told))
        states.append(worlds.get_state(0))
    assert (states[0]["after_layers"][..., 0] != 0).sum() > 5
    for name, array in states[0].items():
        np.testing.assert_array_equal(states[1][name], array, err_msg=name)
