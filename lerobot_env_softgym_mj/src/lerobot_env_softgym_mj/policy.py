"""Policies of LeRobot for `softgym-mj evaluate`."""

import functools
from typing import Any

import numpy as np
import torch
from dm_env import TimeStep
from lerobot.configs import PreTrainedConfig
from lerobot.envs import preprocess_observation
from lerobot.policies import get_policy_class, make_pre_post_processors

from lerobot_env_softgym_mj.env import converted
from softgym_mj import registry
from softgym_mj.envs.environment import Environment
from softgym_mj.policies.exported import Policy
from softgym_mj.variations.indices import NUM_VARIATIONS


@functools.cache  # `softgym-mj evaluate` makes a policy for each episode.
def _loaded(folder: str) -> tuple[Any, Any, Any]:
    """Returns a policy, what processes its observations and what processes its actions."""
    config = PreTrainedConfig.from_pretrained(folder)
    policy = get_policy_class(config.type).from_pretrained(folder, config=config)
    overrides = {"device_processor": {"device": config.device}}
    return policy.eval(), *make_pre_post_processors(
        config, folder, preprocessor_overrides=overrides
    )


def load_policy(folder: str, env: Environment, seed: int = 0) -> Policy:
    """Returns a trained policy as a function from a time step to an action.

    Policies of one folder share their memory of an episode: play them one after the other.

    Args:
        folder: Folder `pretrained_model` of a checkpoint of `lerobot-train`.
        env: Environment; it observes what the policy's dataset has.
        seed: Seed of policies that sample, such as diffusion; each variation has its own numbers.
    """
    policy, before, after = _loaded(folder)
    record = registry.find(env.name)

    def act(time: TimeStep) -> np.ndarray:
        """Returns an action (n,)."""
        if time.first():
            policy.reset()
            torch.manual_seed(NUM_VARIATIONS * seed + env.task.variation)
        batch = {name: np.asarray(value)[None] for name, value in time.observation.items()}
        observation = preprocess_observation(converted(batch, env.task.actor))
        observation["task"] = [record.summary or record.name]
        with torch.inference_mode():
            action = policy.select_action(before(observation))
        return np.clip(after(action)[0].cpu().numpy(), -1.0, 1.0)

    return act
