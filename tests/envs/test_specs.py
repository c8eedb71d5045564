"""The length of episodes in Gymnasium's specifications, and what ends an episode."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import TimeAwareObservation

from softgym_mj.tasks.straighten_rope import StraightenRope

ROPE = "softgym_mj/StraightenRope-v0"


def length(env):
    """Env steps of an episode."""
    env.reset(seed=0)
    steps, ended = 0, False
    while not ended:
        _, _, terminated, ended, _ = env.step(np.zeros(env.action_space.shape))
        assert not terminated
        steps += 1
    return steps


@pytest.mark.parametrize(
    ("kwargs", "expected"),
    [({}, 75), ({"horizon": 2}, 2), ({"horizon": 80}, 80), ({"actor": "pick_and_place"}, 20)],
)
def test_the_horizon_of_an_environment_ends_it(kwargs, expected):
    """A horizon above the task's own works too: Gymnasium counts no steps."""
    env = gymnasium.make(ROPE, **kwargs)
    assert env.spec.max_episode_steps == env.unwrapped.horizon == expected
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))  # As Minari recovers one.
    for each in (env, again, pickle.loads(pickle.dumps(env)), copy.deepcopy(env)):
        assert each.spec == env.spec
        if each is not again:  # It has a `TimeLimit` of the same length.
            assert "TimeLimit" not in str(each)
    if expected != 20:  # Actions of pick and place take long.
        assert length(env) == length(again) == expected


def test_restored_states_count_from_where_they_were():
    env = gymnasium.make(ROPE, horizon=4)
    env.reset(seed=0)
    state = env.unwrapped.get_state()
    for _ in range(2):  # As planners do, which look ahead.
        ended = [env.step(np.zeros(8))[3] for _ in range(3)]
        assert ended == [False] * 3
        env.unwrapped.set_state(state)


def test_gymnasiums_limit_on_request():
    env = gymnasium.make(ROPE, max_episode_steps=3)
    assert env.spec.max_episode_steps == 3 and length(env) == 3
    again = gymnasium.make(env.spec)
    assert again.spec.max_episode_steps == 3 and length(again) == 3


def test_vector_environments():
    for mode in ("vector_entry_point", "sync"):
        envs = gymnasium.make_vec(ROPE, num_envs=1, vectorization_mode=mode, horizon=80)
        envs.reset(seed=0)
        ended = [bool(envs.step(np.zeros((1, 8)))[3][0]) for _ in range(80)]
        assert ended == [False] * 79 + [True]
        assert envs.get_attr("horizon") == (80,)
        spec = envs.spec
        envs.close()
        if spec is not None:  # Not of Gymnasium's own vector environments.
            again = gymnasium.make_vec(spec)
            assert again.get_attr("horizon") == (80,)
            again.close()


def test_wrappers_that_ask():
    env = TimeAwareObservation(gymnasium.make(ROPE, horizon=50), normalize_time=True)
    env.reset(seed=0)
    assert env.step(np.zeros(8))[0][-1] == np.float32(1 / 50)


def test_registered_again(register):
    """The id makes the task that was registered last."""
    for horizon, repeat in ((5, 16), (7, 4)):
        record = register("twin_rope", StraightenRope, horizon=horizon, action_repeat=repeat)
        env = gymnasium.make(record.gymnasium_id)
        assert length(env) == env.spec.max_episode_steps == record.horizon == horizon
        # What an episode does, not what it says: a grip moves 1 cm per sim step.
        before = env.reset(seed=0)[0][-6:]
        action = np.zeros(8)
        action[2] = 1.0
        after = env.step(action)[0][-6:]
        assert after[2] - before[2] == pytest.approx(0.01 * repeat, abs=1e-5)
        assert env.unwrapped.dm_env.control_timestep() == pytest.approx(0.01 * repeat)
