"""Interrupted vector environments: their data is that of environments that nobody interrupts."""

import gc
import multiprocessing
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time
import weakref

import gymnasium
import numpy as np
import pytest

import softgym_mj
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import (
    InvalidArgumentError,
    LifecycleError,
    SimulationError,
    SoftGymError,
)
from softgym_mj.vector import pool as vector_pool
from softgym_mj.vector.base import VectorEnv
from softgym_mj.vector.processes import ProcessBackend

ROPE = "softgym_mj/StraightenRope-v0"
PACKAGE = str(pathlib.Path(softgym_mj.__file__).parent)
NUM_ENVS, SEED = 2, 7
FOREVER = 10**6  # A horizon that no test comes to.


def make(**kwargs):
    return gymnasium.make_vec(ROPE, num_envs=NUM_ENVS, num_workers=2, horizon=FOREVER, **kwargs)


class Pair:
    """A vector environment, and single ones that take the steps that it has taken."""

    def __init__(self):
        self.envs = make()
        self.oracle = [SoftGymEnv("straighten_rope", horizon=FOREVER) for _ in range(NUM_ENVS)]
        self._generator = np.random.default_rng(0)
        self._tried: list[np.ndarray] = []
        self.reset()
        self.start()

    def reset(self):
        self.envs.reset(seed=SEED)

    def start(self):
        """Resets the single ones, and forgets what has been tried."""
        for i, env in enumerate(self.oracle):
            env.reset(seed=SEED + i)
        self._taken = 0
        self._tried.clear()

    def step(self):
        """A step of the vector environment with random actions, which may be interrupted."""
        self._tried.append(self._generator.uniform(-1, 1, (NUM_ENVS, 8)).astype(np.float32))
        return self.envs.step(self._tried[-1])

    def follow(self):
        """Takes the steps that have been tried, but not the last if it has not begun."""
        (count,) = {snapshot.step_count for snapshot, _ in self.envs.get_state()}
        new, self._taken = count - self._taken, count
        assert len(self._tried) - 1 <= new <= len(self._tried)
        for actions in self._tried[:new]:
            for env, action in zip(self.oracle, actions, strict=True):
                env.step(action)
        self._tried.clear()

    def check(self):
        """Both are in the same state, and the next step is the same."""
        self.follow()
        observations, rewards, *_, infos = self.step()
        for i, env in enumerate(self.oracle):
            observation, reward, *_, info = env.step(self._tried[0][i])
            assert np.array_equal(observations[i], observation) and rewards[i] == reward
            assert all(infos[key][i] == value for key, value in info.items())
        self._taken += 1
        self._tried.clear()


@pytest.fixture(name="pair")
def _pair():
    pair = Pair()
    yield pair
    pair.envs.close()


def interrupt_at(line):
    """A trace function that raises at the so-manieth line of the package that is run."""
    left = line

    def trace(frame, event, _):
        nonlocal left
        if not frame.f_code.co_filename.startswith(PACKAGE):
            return None
        left -= event == "line"
        if event == "line" and left == 0:
            raise KeyboardInterrupt
        return trace

    return trace


def test_an_interrupt_at_any_line(pair):
    """Calls of `step` in the main thread, the only one in which signals are raised."""
    line, interrupted = 0, True
    while interrupted:
        line += 1
        sys.settrace(interrupt_at(line))
        try:
            pair.step()
            interrupted = False
        except KeyboardInterrupt:
            interrupted = True
        finally:
            sys.settrace(None)
        pair.check()
    assert line > 15


@pytest.mark.parametrize("call", ["step", "reset", "call"])
def test_a_signal_at_any_time(pair, call):
    """SIGINT to the process while it makes calls, as from the stop button of a notebook."""
    repeated = {
        "step": pair.step,
        "reset": pair.reset,
        "call": lambda: pair.envs.get_attr("horizon"),
    }[call]
    for delay in np.random.default_rng(1).uniform(0.0, 0.03, 10):
        with pytest.raises(KeyboardInterrupt):
            threading.Timer(delay, os.kill, [os.getpid(), signal.SIGINT]).start()
            while True:
                repeated()
        if call == "reset":
            pair.reset()
            pair.start()
        pair.check()


SCRIPT = """
import gymnasium, numpy as np, softgym_mj
if __name__ == "__main__":
    envs = gymnasium.make_vec({task!r}, num_envs=2, num_workers=2, context={context!r})
    envs.reset(seed=0)
    print("running", flush=True)
    try:
        while True:
            envs.step(envs.action_space.sample())
    except KeyboardInterrupt:
        print(envs.step(envs.action_space.sample())[1].shape, envs.reset(seed=3)[1]["variation"])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="groups of processes are POSIX's")
@pytest.mark.parametrize("context", ["fork", pytest.param("spawn", marks=pytest.mark.slow)])
def test_ctrl_c_in_a_terminal(tmp_path, context):
    """Goes to all processes; the workers stay, and the script ends well without closing them."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT.format(task=ROPE, context=context))
    process = subprocess.Popen(
        [sys.executable, str(script)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout.readline() == "running\n"
    time.sleep(0.1)
    os.killpg(process.pid, signal.SIGINT)
    answer, errors = process.communicate(timeout=60)
    expected = [SoftGymEnv("straighten_rope").reset(seed=3 + i)[1]["variation"] for i in range(2)]
    assert (answer.split(" ", 1)[1], errors, process.returncode) == (
        f"{np.array(expected)}\n", "", 0,
    )  # fmt: skip


def test_lost_workers_stay_lost_and_nobody_else_complains(capfd):
    envs = make()
    envs.reset(seed=SEED)
    victim, survivor = multiprocessing.active_children()
    victim.kill()
    victim.join()
    for call in (lambda: envs.step(np.zeros((2, 8))), envs.reset, envs.get_state):
        with pytest.raises(SimulationError, match="has ended"):
            call()
    envs.close()
    assert not survivor.is_alive() and capfd.readouterr().err == ""


class Stuck(gymnasium.Env):
    """Environment whose step takes an hour."""

    observation_space = gymnasium.spaces.Box(-1, 1, (1,), np.float32)
    action_space = gymnasium.spaces.Box(-1, 1, (1,), np.float32)

    def reset(self, *, seed=None, options=None):
        return np.zeros(1, np.float32), {}

    def step(self, action):
        time.sleep(3600)


def test_nobody_waits_for_a_stuck_worker(monkeypatch):
    monkeypatch.setattr(vector_pool, "PATIENCE", 0.1)
    before = set(multiprocessing.active_children())
    backend = ProcessBackend(Stuck, 2, num_workers=2)
    envs = VectorEnv(backend, [0], gymnasium.vector.AutoresetMode.NEXT_STEP)
    envs.reset()
    threading.Timer(0.2, os.kill, [os.getpid(), signal.SIGINT]).start()
    with pytest.raises(KeyboardInterrupt):
        envs.step(np.zeros((2, 1)))
    start = time.monotonic()
    envs.close()
    assert time.monotonic() - start < 10.0
    assert set(multiprocessing.active_children()) <= before


def _use(envs, queue):
    try:
        envs.step(np.zeros((2, 8)))
    except LifecycleError as error:
        queue.put(str(error))
    envs.close()


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="this system cannot fork"
)
def test_a_fork_leaves_it_alone(pair):
    """It has none of the threads of the process that it was forked from."""
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_use, args=(pair.envs, queue))
    child.start()
    assert "was forked: make a new one" in queue.get(timeout=60)
    child.join()
    pair.check()


def test_answers_that_cannot_leave_their_worker():
    envs = make(render_mode="rgb_array")
    envs.reset(seed=SEED)
    envs.render()
    with pytest.raises(SoftGymError, match=r"of 'call' cannot be sent by its worker: .*pickle"):
        envs.get_attr("_view")  # It has OpenGL's objects.
    with pytest.raises(Exception, match=r"pickle|local"):
        envs.call("set_state", lambda: None)  # It is sent to no worker.
    assert envs.get_attr("horizon") == (FOREVER,) * NUM_ENVS
    envs.close()


def test_workers_end_with_the_last_reference():
    before = set(multiprocessing.active_children())
    envs = make()
    envs.reset(seed=SEED)
    with pytest.raises(InvalidArgumentError):  # Its traceback has the environment.
        envs.step(np.full((2, 8), np.nan))
    unwrapped = weakref.ref(envs.unwrapped)
    del envs
    gc.collect()
    assert unwrapped() is None and set(multiprocessing.active_children()) <= before
