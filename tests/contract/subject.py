"""A process that takes input of any kind, one after the other, and says how each ended."""

import contextlib
import io
import multiprocessing
import os
import pathlib
import sys
import traceback
import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

PATIENCE = 120.0  # [s] For an answer; what is accepted is built and stepped.


class Outcome(NamedTuple):
    """How a call ended.

    Attributes:
        kind: "done"; "refused", by a typed error or a usage message; "leaked", by anything else.
        text: the message, or the traceback.
    """

    kind: str
    text: str


class Subject:
    """The process; another one takes its place after a call that ended it or took too long."""

    def __init__(self, folder: pathlib.Path):
        """Nothing is started yet; it works in a folder."""
        self._folder = folder
        self._process: Any = None

    def __call__(self, door: str, arguments: Any) -> Outcome:
        """What comes of passing arguments through one of `DOORS`."""
        if self._process is None:
            context = multiprocessing.get_context("spawn")
            self._pipe, other = context.Pipe()
            self._process = context.Process(target=_serve, args=(other, self._folder), daemon=True)
            self._process.start()
            other.close()
        self._pipe.send((door, arguments))
        try:
            if self._pipe.poll(PATIENCE):
                return self._pipe.recv()
            self._process.kill()
            reason = f"no answer within {PATIENCE} s"
        except (EOFError, ConnectionError):
            self._process.join()
            reason = f"the process ended with {self._process.exitcode}"
        self._process = None
        return Outcome("leaked", reason)

    def close(self) -> None:
        """Ends the process."""
        if self._process is not None:
            self._process.kill()


def _serve(pipe: Any, folder: pathlib.Path) -> None:
    os.chdir(folder)
    os.environ["MINARI_DATASETS_PATH"] = str(folder / "minari")
    with contextlib.suppress(EOFError):
        while True:
            door, arguments = pipe.recv()
            pipe.send(_outcome(door, arguments))


def _outcome(door: str, arguments: Any) -> Outcome:
    import softgym_mj
    from softgym_mj.exceptions import SoftGymError

    try:
        with warnings.catch_warnings(action="ignore"):
            text = DOORS[door](arguments)
        return Outcome("refused" if text else "done", text or "")
    except SoftGymError as error:
        return Outcome("refused", f"{type(error).__name__}: {error}")
    except BaseException as error:
        # What Gymnasium or dm_control refuse before it comes here is theirs.
        where = "".join(traceback.format_exception(error))  # With what it was raised from.
        ours = str(pathlib.Path(softgym_mj.__file__).parent) in where
        return Outcome("leaked" if ours else "refused", where)


def _play(env: Any, action: Any) -> None:
    env.reset()
    env.step(action)
    env.close()


def _load(arguments: tuple[Any, Mapping[str, Any]]) -> None:
    import softgym_mj

    task, settings = arguments
    env = softgym_mj.load(task, **settings)
    _play(env, env.action_spec().generate_value())


def _make(arguments: tuple[str, Mapping[str, Any]]) -> None:
    import gymnasium

    identifier, settings = arguments
    # The checker has asserts of its own.
    env = gymnasium.make(identifier, **{"disable_env_checker": True, **settings})
    _play(env, env.action_space.sample() * 0)


def _make_vec(arguments: tuple[str, Mapping[str, Any]]) -> None:
    import gymnasium

    identifier, settings = arguments
    envs = gymnasium.make_vec(identifier, **{"device": "host", **settings})
    _play(envs, envs.action_space.sample() * 0)


def _suite(arguments: tuple[Any, Any, Any, Any]) -> None:
    from dm_control import suite

    task, task_kwargs, environment_kwargs, visualize_reward = arguments
    env = suite.load("softgym", task, task_kwargs, environment_kwargs, visualize_reward)
    _play(env, env.action_spec().generate_value())


def _command(arguments: list[str]) -> str:
    """The message of a command line that was refused."""
    from softgym_mj.cli import commands

    printed = io.StringIO()
    sys.argv = ["softgym-mj", *arguments]
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        try:
            commands.main()
        except SystemExit as end:
            if end.code not in (0, None):
                assert end.code in (1, 2), f"status {end.code}: {printed.getvalue()}"
                assert "Traceback" not in printed.getvalue(), printed.getvalue()
                assert printed.getvalue().strip(), "no message"
                return printed.getvalue()
    return ""


DOORS = {"load": _load, "make": _make, "make_vec": _make_vec, "suite": _suite, "command": _command}
