"""Plays an episode in any process, from picklable arguments."""

import functools
import json
import pickle

import numpy as np

from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.policies.factory import make_policy
from softgym_mj.recording.episodes import play
from softgym_mj.recording.noise import disturbance
from softgym_mj.registry import TaskRecord

RESTING = 0.01  # [m/s] SoftGym's threshold for ropes and piles at rest.


def played(
    task: TaskRecord | bytes,
    settings: str,
    policy: str,
    seed: int,
    trust: bool,
    idle: str,
    noise: float,
    variation: int,
) -> dict[str, np.ndarray]:
    """Plays an episode and returns its arrays, as `play` does.

    Args:
        task: Value of `policies.rollouts.sent_to`.
        settings: Keyword arguments of the environment as JSON.
        policy, seed, trust, idle, noise: Arguments of `recording.record`.
        variation: Index 0..999.
    """
    env = _environment(task, settings)
    # A new policy for each episode: it cannot depend on earlier ones.
    act = make_policy(policy, env.dm_env, seed, trust=trust)
    disturb = disturbance(env.dm_env.task.actor, noise, seed, variation)

    def finished() -> bool:
        return getattr(act, "finished", False)  # Only experts have this attribute.

    def at_rest(info: dict) -> bool:
        # Water has no `max_speed`.
        return idle == "drop" and finished() and info.get("max_speed", 0.0) < RESTING

    def disturbed(action: np.ndarray) -> np.ndarray:
        # An expert that has finished would not correct the noise.
        return action if finished() else disturb(action)

    return play(env, act, variation, at_rest, disturbed if noise else None)


@functools.lru_cache(maxsize=1)
def _environment(task: TaskRecord | bytes, settings: str) -> SoftGymEnv:
    """Returns this process's cached environment of a task."""
    record = pickle.loads(task).fn if isinstance(task, bytes) else task
    return SoftGymEnv(record, split="all", **json.loads(settings))
