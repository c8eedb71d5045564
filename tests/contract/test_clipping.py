"""Actions outside of the box: clipped with a warning, or refused, by one rule everywhere."""

import re
import warnings

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode

import softgym_mj
from softgym_mj.compat import SOFTGYM_ENVS, normalize
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.vector.base import VectorEnv
from softgym_mj.vector.batch.backend import BatchBackend
from tests.native.torch_device import TorchDevice

TASK, SETTINGS = "straighten_rope", {"fidelity": "fast", "split": [3]}
WIDE = np.array([1.5, -7.0, 0.3, 2.0, -1.0, 0.0, 1.0, -1.001])
WARNING = "clipped"


def vector(device, **settings):
    envs = softgym_mj.make_vec(TASK, 2, device=device, num_workers=1, **SETTINGS, **settings)
    envs.reset(seed=0)
    return envs


def tensors(**settings):
    """Rows in tensors, as on a GPU."""
    backend = BatchBackend(SoftGymEnv(TASK, **SETTINGS, **settings), 2, TorchDevice())
    envs = VectorEnv(backend, SETTINGS["split"], AutoresetMode.NEXT_STEP)
    envs.reset(seed=0)
    return envs


def single(**settings):
    env = SoftGymEnv(TASK, **SETTINGS, **settings)
    env.reset(seed=0)
    return env


def test_gymnasium_clips_and_warns_once():
    env, expected = single(), single()
    with pytest.warns(UserWarning, match=WARNING):
        first = env.step(WIDE)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        second = env.step(WIDE.tolist())
        inside = [expected.step(np.clip(WIDE, -1.0, 1.0)) for _ in range(2)]
        expected.step(np.full(8, 1.0 + 5e-7))  # Rounding of float32.
    for one, other in zip((first, second), inside, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1] == other[1]


@pytest.mark.parametrize("device", ["cpu", "host"])
def test_vectors_clip_and_warn_once(device):
    env, envs = single(), vector(device)
    with pytest.warns(UserWarning, match=WARNING):
        found = envs.step(np.stack([WIDE, np.zeros(8)]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        expected = env.step(np.clip(WIDE, -1.0, 1.0))
        envs.step(np.stack([WIDE, WIDE]))
    np.testing.assert_array_equal(found[0][0], expected[0])
    envs.close()


def test_tensors_are_clipped_without_a_warning():
    env, envs = single(), tensors()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = envs.step(torch.tensor(np.stack([WIDE, np.zeros(8)])))
    expected = env.step(np.clip(WIDE, -1.0, 1.0))
    np.testing.assert_allclose(found[0][0].numpy(), expected[0], rtol=1e-6, atol=1e-7)
    envs.close()


def test_the_switch_refuses():
    made = [vector("cpu", clip_actions=False), vector("host", clip_actions=False)]
    made.append(tensors(clip_actions=False))
    for bad in (1.5, -1.5, np.nan, np.inf):
        actions = np.zeros((2, 8))
        actions[1, 6] = bad
        message = rf"\[1, 6\] = {re.escape(str(bad))}, of environment 1, must be finite and within"
        for envs, given in zip(made, (actions, actions, torch.tensor(actions)), strict=True):
            with pytest.raises(InvalidArgumentError, match=message):
                envs.step(given)
        with pytest.raises(InvalidArgumentError, match="finite and within"):
            single(clip_actions=False).step(actions[1])
    for envs in made:
        envs.close()


def test_what_is_not_finite_is_refused_everywhere():
    env = single()
    for bad in (np.nan, np.inf, -np.inf):
        with pytest.raises(InvalidArgumentError, match="finite"):
            env.step(np.full(8, bad))
    assert env.dm_env.step_count == 0


def test_the_switch_passes_through_gymnasium():
    identifier = "softgym_mj/StraightenRope-v0"
    env = gymnasium.make(identifier, clip_actions=False)
    env.reset()
    with pytest.raises(InvalidArgumentError, match="finite and within"):
        env.step(WIDE)
    with pytest.raises(InvalidArgumentError, match="clip_actions=3"):
        SoftGymEnv(TASK, clip_actions=3)


def test_environments_of_softgym_clip_to_their_units_and_warn_once():
    raw = SOFTGYM_ENVS["PassWater"](observation_mode="key_point", action_mode="direct")
    for env in (raw, normalize(raw)):
        env.reset()
        with pytest.warns(UserWarning, match=WARNING):
            env.step(3.0 * env.action_space.high)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            env.step(3.0 * env.action_space.high)
