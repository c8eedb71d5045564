"""Checks of arms in batches against arms in environments."""

import sys
from collections.abc import Callable, Iterator

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode

from softgym_mj.batch.device import Device
from softgym_mj.envs.environment import Environment
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError, UnavailableError
from softgym_mj.policies.experts import make_policy
from softgym_mj.rendering.observables import WRIST_RGB
from softgym_mj.vector.base import VectorEnv
from softgym_mj.vector.batch.backend import BatchBackend
from tests.vector.same import same
from tests.vector.test_images import check_images

# JAX compiles once for all batches of three environments with arms of a kind on the same mounts.
VARIATIONS = [800, 801, 802]
STEPS = 20  # Env steps over which paths of the arms are compared.


def batch(device: Device, task: str, mode: str = "NextStep", **settings) -> VectorEnv:
    """A batch on a device."""
    env = SoftGymEnv(task, **settings)
    return VectorEnv(BatchBackend(env, 3, device), VARIATIONS, AutoresetMode(mode))


def reset(envs: VectorEnv):
    """Starts an episode of each variation."""
    return envs.reset(seed=0, options={"variation": VARIATIONS})


def recorded(env: Environment) -> list[tuple[list, list]]:
    """Returns an expert's episodes: actions, and observations and infos, of each variation."""
    found = []
    for variation in VARIATIONS:
        timestep = env.reset(variation)
        policy, actions, seen = make_policy(env), [], [(timestep.observation, env.info())]
        while not timestep.last():
            actions.append(policy(timestep))
            timestep = env.step(actions[-1])
            seen.append((timestep.observation, env.info()))
        found.append((actions, seen))
    return found


def replayed(
    envs: VectorEnv, episodes: list[tuple[list, list]], rtol: float
) -> Iterator[tuple[dict, dict]]:
    """Checks starts of `recorded` episodes; yields observations and infos after each action."""
    observations, infos = reset(envs)
    for i, (_, seen) in enumerate(episodes):
        for name, array in seen[0][0].items():
            np.testing.assert_allclose(observations[name][i], array, rtol=rtol, err_msg=name)
        assert {name for name in infos if not name.startswith("_")} == set(seen[0][1])
    for k in range(envs.get_attr("horizon")[0]):
        observations, *_, infos = envs.step(np.array([actions[k] for actions, _ in episodes]))
        yield observations, infos
    envs.close()


def sensed(episodes: list[tuple[list, list]]) -> np.ndarray:
    """Returns proprioceptions (steps, variations, n) after each action of recorded episodes."""
    found = [[each["proprioception"] for each, _ in seen[1:]] for _, seen in episodes]
    return np.array(found).swapaxes(0, 1)


def check_snapshots(envs: VectorEnv, alone: SoftGymEnv, actions: np.ndarray, atol: float) -> None:
    """Checks that snapshots of a batch that was reset continue in an environment and back.

    Args:
        envs: Three environments, observed in full and as "markov"; they are closed.
        alone: Environment of the same task and settings.
        actions: Eight actions of the batch.
        atol: Largest difference of an observation.
    """
    for each in actions[:4]:
        envs.step(each)
    states = envs.get_state()
    later = [envs.step(each)[0] for each in actions[4:]]
    observation, _ = alone.set_state(states[1])
    for k, each in enumerate(actions[4:]):
        if k == 2:
            middle = alone.get_state()
        observation = alone.step(each[1])[0]
        for name in ("full", "markov"):
            np.testing.assert_allclose(observation[name], later[k][name][1], atol=atol)
    envs.set_state(states)
    again = [envs.step(each)[0] for each in actions[4:]]
    assert same(later, again)
    envs.set_state([middle] * 3)
    for k in (2, 3):
        observations = envs.step(np.tile(actions[4 + k][1], (3, 1)))[0]
        for name in ("full", "markov"):
            np.testing.assert_allclose(observations[name][2], later[k][name][1], atol=atol)
    envs.close()


def check_pictures(
    envs: VectorEnv, env: SoftGymEnv, action: list[float], compared: list[int], wrist: float
) -> tuple[dict, dict]:
    """Checks images of the second variation; returns the last ones of the batch and of `env`.

    Args:
        envs: Three environments that observe `IMAGES`; they are closed, as `env` is.
        env: Environment with the same settings.
        action: Action of each env step.
        compared: Numbers of env steps after which images are compared, in order.
        wrist: Largest mean difference of colors of the cameras at wrists.
    """
    (seen, _), (alone, _) = reset(envs), env.reset(options={"variation": VARIATIONS[1]})
    own = np.array(action, np.float32)
    for k in range(compared[-1] + 1):
        if k > 0:
            seen, alone = envs.step(np.stack([own] * 3))[0], env.step(own)[0]
        if k in compared:
            check_images({name: array[1] for name, array in seen.items()}, alone, color=5.0)
    wrists = seen[WRIST_RGB][1].astype(float), alone[WRIST_RGB]
    assert np.abs(np.subtract(*wrists)).mean() < wrist
    envs.close()
    env.close()
    return {name: array[1] for name, array in seen.items()}, alone


def check_tensors(arrays: VectorEnv, tensors: VectorEnv, actions: np.ndarray) -> None:
    """Checks that batches of horizon 3 that observe one vector do the same in five env steps."""
    outcomes: list[list] = []
    for envs in (arrays, tensors):
        reset(envs)
        outcomes.append([])
        for k, each in enumerate(actions):
            own = torch.from_numpy(each) if envs is tensors else each
            seen, rewards, _, truncated, _ = envs.step(own)
            outcomes[-1].append((np.asarray(seen), np.asarray(rewards)))
            assert np.asarray(truncated).all() == (k == 2)
        envs.close()
    for ours, theirs in zip(*outcomes, strict=True):
        for array, other in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(other, array, rtol=1e-5, atol=1e-6)


def check_failures(make: Callable[[], VectorEnv], actions: np.ndarray) -> None:
    """Checks batches of tensors where the second environment gets NaN, and arms that diverge."""
    outcomes: list[list] = []
    for spoils in (False, True):
        envs = make()
        reset(envs)
        outcomes.append([])
        for k, each in enumerate(torch.from_numpy(actions)):
            bad = spoils and k in (1, 3)
            if spoils and k == 1:
                each[1, 0] = torch.nan
            if spoils and k == 3:
                envs.backend._physics.state["arms"]["speeds"][1] = torch.inf
            seen, _, terminated, _, infos = envs.step(each)
            assert terminated.tolist() == [False, bad, False]
            assert infos["physics_warnings"].tolist() == [0, int(bad), 0]
            assert all(array.isfinite().all() for array in seen.values())
            outcomes[-1].append({name: array[[0, 2]].numpy() for name, array in seen.items()})
        envs.close()
    assert same(*outcomes)


def check_refusals(monkeypatch: pytest.MonkeyPatch, module: str, make: Callable[..., VectorEnv]):
    """Checks that odd numbers of sim steps are refused, and arms where JAX is missing."""
    with pytest.raises(InvalidArgumentError, match=r"action_repeat=3 \(odd\) with arms"):
        make(action_repeat=3)
    monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(UnavailableError, match=r"JAX is missing.*gpu-arms"):
        make()
