"""The checkers of Stable-Baselines3 and TorchRL find nothing wrong with any task."""

import warnings

import gymnasium
import pytest
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.env_checker import check_env

import softgym_mj

SEVERAL = {"observation": ["reduced", "markov", "rgb"], "image_size": (64, 64)}
IMAGES = {"observation": "rgb", "image_size": (64, 64)}
FEW = ("straighten_rope", "spread_cloth", "pour_water")  # One of each material by default.
CASES = [
    *(
        pytest.param(task, {}, marks=() if task in FEW else pytest.mark.slow)
        for task in softgym_mj.TASKS
    ),
    ("straighten_rope", SEVERAL),
    ("straighten_rope", IMAGES),
]


@pytest.fixture(name="torchrl")
def _torchrl():
    """TorchRL, which takes seconds to import."""
    import torchrl.envs.libs.gym
    import torchrl.envs.utils

    return torchrl.envs


def identifier(task):
    return softgym_mj.TASKS[task].gymnasium_id


@pytest.mark.parametrize(("task", "kwargs"), CASES, ids=str)
def test_stable_baselines3(task, kwargs):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(identifier(task), **kwargs))


@pytest.mark.parametrize(("task", "kwargs"), CASES, ids=str)
def test_torchrl(torchrl, task, kwargs):
    env = torchrl.libs.gym.GymEnv(identifier(task), **kwargs)
    torchrl.utils.check_env_specs(env, seed=0)
    env.close()


@pytest.mark.parametrize("task", FEW)
def test_torchrl_reads_infos(torchrl, task):
    env = torchrl.libs.gym.GymEnv(identifier(task)).auto_register_info_dict()
    torchrl.utils.check_env_specs(env, seed=0)
    assert "normalized_performance" in env.observation_spec.keys(True)
    played = env.rollout(3)
    score = env._env.unwrapped.dm_env.info()["normalized_performance"]
    assert played["next", "normalized_performance"][-1].item() == pytest.approx(score, rel=1e-6)
    env.close()


@pytest.mark.parametrize("mode", ["SameStep", "Disabled"])
@pytest.mark.parametrize("device", ["cpu", "host"])
def test_torchrl_wraps_many_environments(torchrl, device, mode):
    settings = {"num_workers": 1, "autoreset_mode": mode, "device": device, "horizon": 4}
    envs = gymnasium.make_vec(identifier("straighten_rope"), 2, **settings)
    assert envs.autoreset_mode == envs.metadata["autoreset_mode"] == AutoresetMode(mode)
    env = torchrl.libs.gym.GymWrapper(envs)
    rewards = env.rollout(4)["next", "reward"]
    assert rewards.shape[:2] == (2, 4) and len(set(rewards.flatten().tolist())) > 4
    env.close()
