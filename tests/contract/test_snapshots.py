"""Snapshots restore exactly: grip, counters, random state, in this and in another instance."""

import pickle

import numpy as np

from tests.contract.test_contract import actions, make, parametrized


def grip_something(env):
    """Lowers picker 0 onto its nearest vertex and lifts it."""
    actor, target = env.task.actor, env.task.objects[0]
    for _ in range(12):
        gap = target.points() - actor.positions()[0]
        nearest = gap[np.argmin(np.linalg.norm(gap, axis=1))]
        action = np.zeros(8)
        action[:3] = np.clip((nearest + [0, 0, actor.radius]) / 0.08, -1, 1)
        action[3] = 1.0
        env.step(action)
        if actor.held[0] >= 0:
            break
    assert actor.held[0] >= 0


def pour_something(env):
    """Lifts and tips the cup until water leaves it."""
    for _ in range(20):
        env.step(np.array([0.2, 1.0, 1.0]))
    assert env.info()["fraction_in_cup"] < 1.0


def push_something(env):
    """Pushes the cup at full speed."""
    for _ in range(5):
        env.step(np.ones(1))


def move_about(env):
    """Some random actions."""
    for action in actions(env, 3, seed=2):
        env.step(action)


# What goes on when the snapshot is taken.
BUSY = {
    "spread_cloth": grip_something,
    "fold_cloth": grip_something,
    "straighten_rope": grip_something,
    "rope_configuration": grip_something,
    "transport_water": push_something,
    "pour_water": pour_something,
    "pour_water_amount": pour_something,
}


# One of each kind of object, measure and actor; golden episodes restore all in one instance.
USUAL = (
    "rope_configuration", "fold_cloth", "drop_cloth", "transport_water", "pour_water_amount",
    "spread_cloth/pick_and_place", "straighten_rope/pixel_pick_and_place",
)  # fmt: skip


def busy(case, **settings):
    """An environment in the middle of something."""
    env = make(case, **settings)
    env.reset(800)
    BUSY.get(case, move_about)(env)
    return env


def trace(env, act):
    """Observations and rewards of a list of actions, as bits."""
    steps = [env.step(action) for action in act]
    rows = [np.append(s.observation["full"], -1 if s.reward is None else s.reward) for s in steps]
    return np.array(rows)


@parametrized(USUAL)
def test_a_restore_continues_bit_equal(case):
    env = busy(case, observation="full")
    act = actions(env, 2 if "/" in case else 10, seed=1)  # A pick and place takes 1 to 3 s.
    if act.shape[1] == 8:
        act[:5, 3] = 1.0  # Keeps holding for a while.
    snapshot = pickle.loads(pickle.dumps(env.get_state()))
    expected = trace(env, act)
    env.set_state(snapshot)
    np.testing.assert_array_equal(trace(env, act), expected)
    other = make(case, observation="full", random_state=7)
    other.reset(803)  # Another variation, of another size for cloth and water.
    trace(other, act[:1])
    other.set_state(snapshot)
    assert other.task.variation == 800
    np.testing.assert_array_equal(trace(other, act), expected)
    assert env.info() == other.info()
    fresh = make(case, observation="full")
    fresh.set_state(snapshot)  # Without a reset.
    np.testing.assert_array_equal(trace(fresh, act[:4]), expected[:4])


def test_a_restore_includes_counter_random_state_and_end():
    env = make("straighten_rope", horizon=2, random_state=5)
    env.reset()
    act = actions(env, 4)
    env.step(act[0])
    snapshot = env.get_state()
    assert env.step(act[1]).last()
    next_variation = (env.step(act[2]), env.task.variation)[1]
    env.set_state(snapshot)
    assert env.step_count == 1
    assert env.step(act[1]).last()
    env.step(act[2])
    assert env.task.variation == next_variation
