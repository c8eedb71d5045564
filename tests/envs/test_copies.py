"""Copies and pickles of environments continue where the original stands."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest

import softgym_mj
from softgym_mj.envs.environment import Environment
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import (
    InvalidArgumentError,
    LifecycleError,
    SnapshotError,
    UnexpectedArgumentError,
)

IDENTIFIER = "softgym_mj/StraightenRope-v0"
COPIES = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
}


def continues(env, twin):
    """Whether both do the same to the end of this episode and in the next, with own samples."""
    for _ in range(2):
        truncated = False
        while not truncated:
            action = env.action_space.sample()
            assert np.array_equal(action, twin.action_space.sample())
            one, other = env.step(action), twin.step(action)
            assert np.array_equal(one[0], other[0]) and one[1:] == other[1:]
            truncated = one[3]
        (one, info), (other, other_info) = env.reset(), twin.reset()
        assert np.array_equal(one, other) and info == other_info
    return True


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
def test_in_the_middle_of_an_episode(copied):
    env = SoftGymEnv("straighten_rope", horizon=6)
    env.reset(seed=3)
    env.action_space.seed(4)
    for _ in range(3):
        env.step(env.action_space.sample())
    assert continues(env, copied(env))


@pytest.mark.parametrize("copied", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("started", [False, True])
def test_of_load(copied, started):
    env = softgym_mj.load("straighten_rope", horizon=4, random_state=3, observation=["reduced"])
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (12, 8))
    if started:
        env.reset(), env.step(actions[0])
    twin = copied(env)
    assert twin.task is not env.task and twin.horizon == 4
    if not started:
        env.reset(), twin.reset()
    for action in actions:  # Over three episodes.
        one, other = env.step(action), twin.step(action)
        np.testing.assert_array_equal(one.observation["reduced"], other.observation["reduced"])
        assert one[:3] == other[:3] and env.info() == twin.info()


def test_of_a_constructor_and_after_close():
    env = softgym_mj.load("straighten_rope")
    own = Environment(env.task, name="own", horizon=3)
    with pytest.raises(LifecycleError, match="get_state"):
        copy.deepcopy(own)
    env.close()
    with pytest.raises(LifecycleError, match="closed"):
        pickle.dumps(env)


def test_of_gymnasium_make():
    env = gymnasium.make(IDENTIFIER, horizon=3)
    env.reset(seed=3)
    twin = copy.deepcopy(env)
    assert twin.unwrapped is not env.unwrapped and twin.spec == env.spec
    env.action_space.seed(4), twin.action_space.seed(4)
    assert continues(env, twin)


def test_before_the_first_reset_and_after_close():
    """The generator is copied, too, where there is one."""
    env = SoftGymEnv("straighten_rope")
    _ = env.np_random
    twins = [copied(env) for copied in COPIES.values()]
    info = env.reset()[1]
    assert all(twin.reset()[1] == info for twin in twins)
    env.close()
    for copied in COPIES.values():
        with pytest.raises(LifecycleError):
            copied(env)


def test_a_state_is_a_reset_to_wrappers():
    """What `gymnasium.make` wraps around wants a reset before a step."""
    env, twin = gymnasium.make(IDENTIFIER), gymnasium.make(IDENTIFIER)
    env.reset(seed=3)
    observation, *_, info = env.step(np.ones(8))
    state = env.unwrapped.get_state()
    restored, restored_info = twin.reset(options={"state": state})
    assert np.array_equal(restored, observation) and restored_info == info
    assert np.array_equal(twin.step(-np.ones(8))[0], env.step(-np.ones(8))[0])
    assert env.reset()[1] == twin.reset()[1]
    for beside in ({"seed": 3}, {"options": {"state": state, "variation": 3}}):
        with pytest.raises(
            InvalidArgumentError, match="=3 is not valid: expected None with the option 'state'"
        ):
            twin.reset(**{"options": {"state": state}, **beside})
    with pytest.raises(SnapshotError, match="get_state"):
        twin.reset(options={"state": None})


def test_the_random_state_is_a_seed_of_reset():
    with pytest.raises(UnexpectedArgumentError, match=r"'random_state': seed it by reset\(seed="):
        gymnasium.make(IDENTIFIER, random_state=3)
