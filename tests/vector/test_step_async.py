"""Steps in two calls, with what the caller does in between."""

import functools
import os
import pathlib
import signal
import threading
import time

import gymnasium
import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError
from softgym_mj.vector.base import VectorEnv
from softgym_mj.vector.processes import ProcessBackend
from tests.vector.same import same

PATIENCE = 60.0  # [s]


def seen(file: pathlib.Path) -> bool:
    """Whether a file appears."""
    end = time.monotonic() + PATIENCE
    while not file.exists() and time.monotonic() < end:
        time.sleep(0.01)
    return file.exists()


class Handshake(gymnasium.Env):
    """Environment whose step signals its begin and waits for a signal of the caller."""

    observation_space = action_space = gymnasium.spaces.Box(-1, 1, (1,), np.float32)

    def __init__(self, folder: pathlib.Path):
        self._folder = folder

    def reset(self, *, seed=None, options=None):
        return np.zeros(1, np.float32), {}

    def step(self, action):
        (self._folder / "begun").touch()
        return np.zeros(1, np.float32), float(seen(self._folder / "computed")), False, False, {}


@pytest.fixture(name="handshake")
def _handshake(tmp_path):
    backend = ProcessBackend(functools.partial(Handshake, tmp_path), 1)
    envs = VectorEnv(backend, [0], gymnasium.vector.AutoresetMode.NEXT_STEP)
    envs.reset()
    yield envs
    (tmp_path / "computed").touch()
    envs.close()


def test_the_caller_computes_meanwhile(handshake, tmp_path):
    handshake.step_async(np.zeros((1, 1)))
    assert seen(tmp_path / "begun")
    (tmp_path / "computed").touch()
    assert handshake.step_wait()[1].tolist() == [1.0]


@pytest.fixture(name="envs", scope="module")
def _envs():
    """Reset before each use."""
    envs = softgym_mj.make_vec("straighten_rope", 2, num_workers=2, horizon=3)
    yield envs
    envs.close()


def test_both_are_a_step(envs):
    actions = np.random.default_rng(0).uniform(-1, 1, (4, 2, 8))
    envs.reset(seed=7)
    expected = [envs.step(action) for action in actions]
    envs.reset(seed=7)
    for action, result in zip(actions, expected, strict=True):
        envs.step_async(action)
        action[:] = 0.0  # The caller's buffer is free again.
        assert same(envs.step_wait(), result)


def test_what_cannot_be_done_meanwhile(envs):
    envs.reset(seed=7)
    actions = np.zeros((2, 8))
    with pytest.raises(LifecycleError, match=r"no step has begun: call step_async"):
        envs.step_wait()
    with pytest.raises(InvalidArgumentError):
        envs.step_async(actions[:1])
    envs.step_async(actions)
    for call in (
        lambda: envs.step_async(actions),
        lambda: envs.step(actions),
        lambda: envs.reset(seed=7),
        envs.get_state,
        envs.render,
        lambda: envs.get_attr("horizon"),
        lambda: envs.set_attr("mark", 1),
    ):
        with pytest.raises(LifecycleError, match=r"a step has begun: call step_wait\(\) first"):
            call()
    envs.step_wait()
    assert [state[0].step_count for state in envs.get_state()] == [1, 1]


def test_closed_meanwhile(tmp_path):
    envs = softgym_mj.make_vec("straighten_rope", 1, horizon=3)
    envs.reset(seed=7)
    envs.step_async(np.zeros((1, 8)))
    envs.close()
    with pytest.raises(LifecycleError):
        envs.step_wait()


class Interrupted(BaseException):
    """Stands for KeyboardInterrupt, which would end the tests if it came too late."""


def interrupt(*_):
    raise Interrupted


def test_interrupted_meanwhile(handshake, tmp_path):
    """The step is taken; its result is lost, as that of an interrupted `step`."""
    usual = signal.signal(signal.SIGUSR1, interrupt)
    handshake.step_async(np.zeros((1, 1)))
    with pytest.raises(Interrupted):
        threading.Timer(0.2, os.kill, [os.getpid(), signal.SIGUSR1]).start()
        handshake.step_wait()
    signal.signal(signal.SIGUSR1, usual)
    (tmp_path / "computed").touch()
    assert handshake.step(np.zeros((1, 1)))[1].tolist() == [1.0]
