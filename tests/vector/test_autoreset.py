"""Tests automatic resets against Gymnasium's own `SyncVectorEnv`."""

import functools

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.vector.base import VectorEnv
from softgym_mj.vector.processes import ProcessBackend
from tests.vector.same import same

HORIZON, SEED, NUM_ENVS = 3, 7, 3
UNLUCKY = 1.0  # The action at which `Odd` raises.


class Odd(gymnasium.Env):
    """Counts steps and episodes, which end in two ways; infos come and go, and are of all kinds."""

    observation_space = Dict(b=Box(-1, 1, (2,), np.float32), a=Box(0, 255, (), np.uint8))
    action_space = Box(-1, 1, (1,), np.float32)
    episode = steps = 0

    def reset(self, *, seed=None, options=None):
        self.episode, self.steps = self.episode + 1, 0
        deep = {"x": 1.5, "deeper": {"y": np.arange(2)}, "none": {}}
        info = {"start": "now", "count": self.episode, "deep": deep, "flag": True}
        return self._observation(), info

    def step(self, action):
        if action[0] == UNLUCKY:
            raise ArithmeticError("bad luck")
        self.steps += 1
        info = {"count": self.steps, "deep": {"z": np.float32(2)}, "numpy": np.bool_(True)}
        if self.steps % 2:
            info["odd"] = np.full((2, 2), self.steps)
        ended = self.steps >= 2 + self.episode % 3
        terminated = ended and self.episode % 2 == 0
        truncated = ended and not terminated
        return self._observation(), float(action[0]), terminated, truncated, info

    def _observation(self):
        return {"a": np.uint8(self.steps), "b": np.array([self.steps, self.episode], "f") / 10}


KINDS = {
    "odd": Odd,
    "rope": functools.partial(
        SoftGymEnv, "straighten_rope", horizon=HORIZON, observation=["full", "reduced"]
    ),
    "water": functools.partial(SoftGymEnv, "transport_water", horizon=HORIZON, fidelity="fast"),
}


def ours(make, mode, num_workers):
    backend = ProcessBackend(make, NUM_ENVS, num_workers=num_workers)
    return VectorEnv(backend, range(800), mode)


@pytest.mark.parametrize(
    ("kind", "mode"),
    [
        *(("odd", mode) for mode in AutoresetMode),
        ("rope", AutoresetMode.SAME_STEP),
        ("water", AutoresetMode.NEXT_STEP),
    ],
)
def test_what_gymnasium_does(kind, mode):
    """Bit for bit, also where episodes of different environments end in different steps."""
    envs = ours(KINDS[kind], mode, num_workers=2)
    oracle = SyncVectorEnv([KINDS[kind]] * NUM_ENVS, autoreset_mode=mode)
    assert same(envs.reset(seed=SEED), oracle.reset(seed=SEED))
    generator = np.random.default_rng(0)
    for step in range(3 * HORIZON):
        actions = generator.uniform(-1, 0.99, envs.action_space.shape).astype(np.float32)
        result, expected = envs.step(actions), oracle.step(actions)
        assert same(result, expected)
        mask = np.array([True, False, True]) if step == 1 else expected[2] | expected[3]
        if step == 1 or (mode == AutoresetMode.DISABLED and mask.any()):
            seeds = [SEED, 1, None] if step == 1 else None
            results = [e.reset(seed=seeds, options={"reset_mask": mask}) for e in (envs, oracle)]
            assert same(*results)
    envs.close(), oracle.close()


def test_an_error_leaves_the_others_where_they_are():
    """Environments that stepped before another raised continue."""
    envs = ours(Odd, AutoresetMode.NEXT_STEP, num_workers=NUM_ENVS)
    envs.reset()
    actions = np.zeros((NUM_ENVS, 1))
    envs.step(actions), envs.step(actions)
    with pytest.raises(ArithmeticError, match="bad luck"):
        envs.step(np.array([[0.0], [UNLUCKY], [0.0]]))  # The last one of the others' episodes.
    observations, _, terminated, truncated, _ = envs.step(actions)
    assert observations["a"].tolist() == [0, 3, 0]
    np.testing.assert_array_equal(observations["b"][:, 1], np.array([2, 1, 2], "f") / 10)
    assert truncated.tolist() == [False, True, False] and not terminated.any()
    envs.close()


def test_staggered_episodes():
    """First episodes are shorter, later ones whole; snapshots store the lengths."""
    make = functools.partial(SoftGymEnv, "straighten_rope", horizon=7)
    envs, twin = (ours(make, AutoresetMode.SAME_STEP, num_workers=1) for _ in range(2))
    envs.reset(seed=SEED, options={"stagger": True})
    twin.reset(seed=SEED)
    twin.set_state(envs.get_state())
    ends = np.array([envs.step(np.zeros((NUM_ENVS, 8)))[3] for _ in range(15)])
    expected = [[7, 14], [5, 12], [3, 10]]  # 7, less 0, 2 and 4 steps; then 7 each.
    assert [(np.flatnonzero(column) + 1).tolist() for column in ends.T] == expected
    again = np.array([twin.step(np.zeros((NUM_ENVS, 8)))[3] for _ in range(15)])
    assert np.array_equal(ends, again)
    envs.reset(options={"stagger": 2})
    ends = np.array([envs.step(np.zeros((NUM_ENVS, 8)))[3] for _ in range(8)])
    assert [(np.flatnonzero(column) + 1).tolist() for column in ends.T] == [[7], [4], [7]]
    with pytest.raises(InvalidArgumentError, match="stagger='yes'"):
        envs.reset(options={"stagger": "yes"})
    envs.reset(options={"stagger": np.True_})
    ends = np.array([envs.step(np.zeros((NUM_ENVS, 8)))[3] for _ in range(7)])
    assert [(np.flatnonzero(column) + 1).tolist() for column in ends.T] == [[7], [5], [3]]
    for stagger in (True, np.True_, 2):
        with pytest.raises(InvalidArgumentError, match=r"stagger=.*'state'"):
            envs.reset(options={"state": envs.get_state(), "stagger": stagger})
    envs.reset(options={"state": envs.get_state(), "stagger": False})
    envs.close(), twin.close()
