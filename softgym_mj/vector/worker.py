"""Worker process of a `ProcessBackend`: answers calls of its environments."""

import functools
import os
import pickle
import signal
import traceback
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.connection import Connection
from typing import Any

import cloudpickle
import gymnasium
import numpy as np
from gymnasium.vector.utils import write_to_shared_memory

from softgym_mj.exceptions import SoftGymError

END = b"end"  # The message that ends a worker.
OUTCOME = gymnasium.spaces.Box(-np.inf, np.inf, (3,), np.float64)  # Reward, terminated, truncated.


def serve(
    pipe: Connection,
    other_end: Connection,
    variables: Mapping[str, str],
    make: bytes,
    space: Any,
    memory: Any,
) -> None:
    """Answers messages until an `END` message arrives or the pipe is closed.

    Args:
        pipe: Receives messages (name and arguments of a call by index of the environment); sends
            whether all calls succeeded, and their answers or the error.
        other_end: The other end of the pipe, which a fork inherits.
        variables: Environment variables of the parent; a fork server has those of its own start.
        make: Pickled function that makes an environment at its first call.
        space: Space of an observation and an `OUTCOME`.
        memory: Shared memory for observations and outcomes of all environments.
    """
    # Ctrl-C in a terminal reaches every process; the main process decides what follows.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    other_end.close()
    os.environ.update(variables)
    made = functools.cache(lambda number: pickle.loads(make)())
    while True:
        try:
            message = pipe.recv_bytes()
            if message == END:
                return
            pipe.send_bytes(_reply(message, made, space, memory))
        except (EOFError, ConnectionError):  # The other end has been killed.
            return


def _reply(message: bytes, *arguments: Any) -> bytes:
    """Returns the pickle of whether all calls succeeded, and of the answers or the error."""
    calls: Mapping[int, tuple] = {}
    try:
        calls = pickle.loads(message)
        succeeded, answer = True, _answers(calls, *arguments)  # type: tuple[bool, Any]
    except Exception as error:
        error.add_note(traceback.format_exc())
        succeeded, answer = False, error
    try:
        return cloudpickle.dumps((succeeded, answer))
    except Exception as error:  # Whatever the answer's own classes raise.
        name = next((name for name, *_ in calls.values()), "start")
        reason = f"{type(answer).__name__} of {name!r} cannot be sent by its worker: {error}"
        return cloudpickle.dumps((False, SoftGymError(reason)))


def _answers(
    calls: Mapping[int, tuple], made: Callable[[int], gymnasium.Env], space: Any, memory: Any
) -> dict[int, Any]:
    """Returns results by environment; of a step or reset the info, the rest is in `memory`."""
    answers = {}
    for i, (name, *arguments) in calls.items():
        if name == "call":
            answers[i] = _call(made(i), *arguments)
        else:
            observation, *outcome, answers[i] = _play(made(i), name, *arguments)
            shown: Any = (observation, outcome)
            write_to_shared_memory(space, i, shown, memory)
    return answers


def _call(env: gymnasium.Env, name: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
    found = env.get_wrapper_attr(name)
    return found(*args, **kwargs) if callable(found) else found


def _play(env: gymnasium.Env, name: str, argument: Any) -> tuple:
    """Returns the result of `step`; for a reset or restored episode, a result of its form."""
    if name == "step":
        return env.step(argument)
    ended, options = False, {"variation": argument}
    if name == "restore":
        ended = argument.ended
        options = {"state": (argument, env.np_random.bit_generator.state)}
    observation, info = env.reset(options=options)
    return observation, 0.0, False, ended, info
