"""The state "markov" tells apart what goes on differently and "reduced" does not."""

import numpy as np
import pytest

import softgym_mj

NAMES = ("reduced", "markov")
CLOSED = np.array([0.0, 0.0, 0.0, 1.0])
OPEN = np.array([0.0, 0.0, 0.0, -1.0])


def load(task, **kwargs):
    return softgym_mj.load(task, observation=NAMES, split="evaluate", **kwargs)


def added(observation):
    """Returns the entries of "markov" after those of "reduced"."""
    reduced, markov = (observation[name] for name in NAMES)
    np.testing.assert_array_equal(markov[: reduced.size], reduced)
    return markov[reduced.size :]


def seen(env):
    """The current observations; an environment's are those after its last step."""
    return {name: env.task.observe(name) for name in NAMES}


def above_the_rope():
    """The pickers a centimeter above the first and the last vertex, open."""
    env = load("straighten_rope")
    env.reset(800)
    actor, points = env.task.actor, env.task.objects[0].points()
    actor.place(points[[0, -1]] + [0.0, 0.0, 0.03], actor._workspace)
    return env


def test_the_same_reduced_and_another_grip():
    """Pickers that hold the ends, and pickers that do not, in the same places."""
    first, second = above_the_rope(), above_the_rope()
    second.task.actor.take([0, 40])
    one, other = seen(first), seen(second)
    np.testing.assert_array_equal(one["reduced"], other["reduced"])
    assert added(one).tolist() == [0.0] * 8
    ends = second.task.objects[0].points()[[0, 40]] - second.task.actor.positions()
    np.testing.assert_array_equal(added(other).reshape(2, 4), np.column_stack([[1, 1], ends]))


def test_a_grip_that_is_closed_and_one_that_has_slipped():
    """Neither holds; the first takes what comes near, the second nothing until it was open."""
    env = above_the_rope()
    env.task.actor.take([0, 40])
    env.task.actor._holding.release_overloaded(1)
    slipped = added(seen(env)).reshape(2, 4)
    assert slipped[:, 0].tolist() == [1.0, -1.0] and not slipped[1, 1:].any()
    action = np.concatenate([CLOSED, CLOSED])
    assert added(env.step(action).observation).reshape(2, 4)[1, 0] == -1.0
    env.step(np.concatenate([CLOSED, OPEN]))
    assert added(env.step(action).observation).reshape(2, 4)[:, 0].tolist() == [1.0, 1.0]


@pytest.mark.parametrize("task", ["transport_water", "pour_water"])
def test_the_velocity_of_a_cup(task):
    """It is that of the last sim step; snapshots and the next episode have it, too."""
    env, twin = (load(task, fidelity="fast") for _ in range(2))
    start = env.reset(803).observation
    assert not added(start).any()
    timestep = env.step(np.full(env.action_spec().shape, 0.5))
    velocity = np.zeros(3)
    moving = env.task.actor.max_step > 0
    velocity[moving] = 0.5 * env.task.actor.max_step[moving] / 0.01
    np.testing.assert_allclose(added(timestep.observation), velocity, rtol=1e-9)
    twin.reset(804)
    twin.set_state(env.get_state())
    for name in NAMES:
        np.testing.assert_array_equal(twin.observation()[name], timestep.observation[name])
    assert not added(env.reset(803).observation).any()


@pytest.mark.parametrize(
    ("task", "kwargs", "number"),
    [
        ("straighten_rope", {"actor": "franka"}, 14),
        ("straighten_rope", {"actor": "franka", "grasp": "friction", "arms": 1}, 7),
        ("transport_water", {"actor": "franka", "fidelity": "fast"}, 3),
    ],
)
def test_arms_remember_their_command(task, kwargs, number):
    env = load(task, **kwargs)
    env.reset(800)
    timestep = env.step(np.full(env.action_spec().shape, 0.4))
    actor, found = env.task.actor, added(timestep.observation)
    assert found.size == number == sum(actor.remembers.values())
    commanded = (
        actor.commanded_pose if task == "transport_water" else actor.commanded_positions().ravel()
    )
    np.testing.assert_array_equal(found[-commanded.size :], commanded)
