"""Tests that workers start without a fork of this process and without its script."""

import multiprocessing
import os
import subprocess
import sys
import threading

import gymnasium
import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.parallel.scripts import unknown_main
from softgym_mj.vector.base import VectorEnv
from softgym_mj.vector.processes import ProcessBackend


class Curious(gymnasium.Env):
    """Returns the parent and a variable of its process as infos."""

    observation_space = action_space = gymnasium.spaces.Box(-1, 1, (1,), np.float32)

    def reset(self, *, seed=None, options=None):
        found = {"parent": os.getppid(), "variable": os.environ.get("CURIOUS", "")}
        return np.zeros(1, np.float32), found


def make(**kwargs):
    backend = ProcessBackend(Curious, 2, num_workers=2, **kwargs)
    return VectorEnv(backend, [0], gymnasium.vector.AutoresetMode.NEXT_STEP)


@pytest.fixture(name="forks", scope="module")
def _forks():
    """Forks of this process, as a list that grows."""
    forks = []
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(before=lambda: forks.append(threading.active_count()))
    return forks


def test_a_process_with_threads_is_not_forked(forks, monkeypatch):
    """State of a process that already has a vector environment and its thread."""
    forks.clear()
    for value in ("first", "second"):  # A fork server has the variables of its own start.
        monkeypatch.setenv("CURIOUS", value)
        envs = make()
        infos = envs.reset()[1]
        assert os.getpid() not in infos["parent"]
        assert infos["variable"].tolist() == [value] * 2
        other = make()
        envs.close(), other.close()
    assert not forks


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="this system cannot fork"
)
def test_a_fork_on_request(forks):
    forks.clear()
    envs = make(context="fork")
    assert envs.reset()[1]["parent"].tolist() == [os.getpid()] * 2 and len(forks) == 2
    envs.close()


def test_what_cannot_be_sent():
    with pytest.raises(InvalidArgumentError, match=r"cannot be sent to worker processes: .*lock"):
        softgym_mj.make_vec("straighten_rope", 1, camera=threading.Lock())


# No `if __name__ == "__main__":`; nothing in it can be imported by others.
SCRIPT = """
import enum, sys
import numpy as np
import softgym_mj
from softgym_mj.tasks.straighten_rope import StraightenRope

print("once", flush=True)

class Mood(enum.Enum):
    GOOD = 1

class TooEasy(Exception):
    pass

class EasyRope(StraightenRope):
    summary = "A custom task of this script."
    def goal(self, variation, points):
        if variation == 3:
            raise TooEasy(variation)
        return super().goal(variation, points)
    def moods(self):
        return [Mood.GOOD]

softgym_mj.register("easy_rope", EasyRope, horizon=2)
envs = softgym_mj.make_vec("easy_rope", 2, num_workers=2, {context})
envs.reset(seed=0)
for _ in range(3):
    envs.step(envs.action_space.sample())
envs.set_attr("mood", Mood.GOOD)
assert envs.get_attr("mood") == (Mood.GOOD,) * 2
try:
    envs.reset(options={{"variation": 3}})
except TooEasy as error:
    print("raised", error)
print(envs.get_attr("horizon"))
"""


@pytest.mark.parametrize(
    ("way", "context"),
    [
        ("file", ""),
        pytest.param("stdin", "", marks=pytest.mark.long),
        pytest.param("command", "", marks=pytest.mark.long),
        pytest.param("file", "context='spawn'", marks=pytest.mark.slow),
        pytest.param("stdin", "context='spawn'", marks=pytest.mark.slow),
    ],
)
def test_scripts_run_once(tmp_path, way, context):
    """Whether they have a file or not, tasks, errors and values of their own classes included."""
    source = SCRIPT.format(context=context)
    script = tmp_path / "script.py"
    script.write_text(source)
    arguments = {"file": [str(script)], "stdin": ["-"], "command": ["-c", source]}[way]
    done = subprocess.run(
        [sys.executable, *arguments], input=source, capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("once\nraised 3\n(2, 2)\n", "")


def test_an_interactive_session(tmp_path):
    code = (
        "import softgym_mj\n"
        "envs = softgym_mj.make_vec('straighten_rope', 2, num_workers=2)\n"
        "print(envs.reset(seed=0)[0].shape)\n"
    )
    done = subprocess.run(
        [sys.executable, "-i", "-q"], input=code, capture_output=True, text=True, check=False
    )
    assert done.stdout == "(2, 36)\n" and "Error" not in done.stderr


def test_threads_that_start_workers_at_once_leave_the_script_alone():
    """Without a lock, the thread that leaves last would restore the other's replacement."""
    main = sys.modules["__main__"]
    entered, second, left = (threading.Event() for _ in range(3))

    def start():
        entered.wait()
        with unknown_main():
            second.set()
            left.wait()

    thread = threading.Thread(target=start)
    thread.start()
    with unknown_main():
        entered.set()
        second.wait(0.2)
    left.set()
    thread.join()
    assert sys.modules["__main__"] is main
