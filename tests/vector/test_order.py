"""Several observations have one order, that of their space, wherever they come from."""

import functools

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import softgym_mj
from softgym_mj.envs.gymnasium_env import SoftGymEnv

KWARGS = {"observation": ["reduced", "held", "full_mask"], "horizon": 2}
SEED, NUM_ENVS = 7, 2


def ours():
    return softgym_mj.make_vec(
        "straighten_rope", NUM_ENVS, num_workers=1, autoreset_mode="SameStep", **KWARGS
    )


def gymnasiums():
    make = functools.partial(SoftGymEnv, "straighten_rope", **KWARGS)
    return SyncVectorEnv([make] * NUM_ENVS, autoreset_mode=AutoresetMode.SAME_STEP)


def joined(observation):
    """All numbers in the order of the dictionary, as code does that flattens observations."""
    return np.concatenate([np.asarray(value, float) for value in observation.values()], axis=-1)


@pytest.mark.parametrize("make", [ours, gymnasiums])
def test_joined_in_order_they_are_the_same_numbers(make):
    """Observations of reset, step, final steps and restored states, single and batched."""
    single = SoftGymEnv("straighten_rope", **KWARGS)
    names = list(single.observation_space.spaces)
    assert names == sorted(KWARGS["observation"]) != KWARGS["observation"]
    envs = make()
    assert list(envs.single_observation_space) == list(envs.observation_space) == names
    seen, _ = envs.reset(seed=SEED)
    alone = single.reset(seed=SEED)[0]
    for _ in range(KWARGS["horizon"]):
        assert list(seen) == list(alone) == names
        np.testing.assert_array_equal(joined(seen)[0], joined(alone))
        actions = envs.action_space.sample()
        seen, *_, infos = envs.step(actions)
        alone = single.step(actions[0])[0]
    for final in infos["final_obs"]:
        assert list(final) == names
    np.testing.assert_array_equal(joined(infos["final_obs"][0]), joined(alone))
    assert list(single.set_state(single.get_state())[0]) == names
    if make is ours:
        assert list(envs.set_state(envs.get_state())[0]) == names
    envs.close()


def test_flattened_by_gymnasium():
    env = gymnasium.make("softgym_mj/StraightenRope-v0", **KWARGS)
    observation = env.reset(seed=SEED)[0]
    flat = gymnasium.spaces.flatten(env.observation_space, observation)
    np.testing.assert_array_equal(flat, joined(observation))
