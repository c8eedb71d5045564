"""The checkers of Stable-Baselines3 and TorchRL find nothing wrong with any task."""

import warnings

import gymnasium
import pytest
from stable_baselines3.common.env_checker import check_env
from torchrl.envs.libs.gym import GymEnv, GymWrapper
from torchrl.envs.utils import check_env_specs

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


def identifier(task):
    return softgym_mj.TASKS[task].gymnasium_id


@pytest.mark.parametrize(("task", "kwargs"), CASES, ids=str)
def test_stable_baselines3(task, kwargs):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(identifier(task), **kwargs))


@pytest.mark.parametrize(("task", "kwargs"), CASES, ids=str)
def test_torchrl(task, kwargs):
    env = GymEnv(identifier(task), **kwargs)
    check_env_specs(env, seed=0)
    env.close()


def test_torchrl_wraps_what_is_made():
    check_env_specs(GymWrapper(gymnasium.make(identifier("straighten_rope"))), seed=0)
