"""What a worker process of a `ProcessBackend` does: it answers calls of its environments."""

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
    """Answers messages until it is told to end, or until nobody is left who could.

    Args:
        pipe: brings messages, the name and the arguments of a call by number of the environment,
            and takes whether all calls succeeded, and their answers or the error.
        other_end: of the pipe, which a fork has, too.
        variables: of the operating system's environment; a fork server has those of its own start.
        make: the pickle of what makes an environment, at its first call.
        space: of what an environment shows, an observation and an `OUTCOME`.
        memory: shared memory that takes what all show.
    """
    # Ctrl-C in a terminal goes to every process of a program. Its first one decides what follows.
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
    """The pickle of whether all calls of a message succeeded, and the answers or the error."""
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
        reason = f"{type(answer).__name__} of {name!r} cannot leave its worker: {error}"
        return cloudpickle.dumps((False, SoftGymError(reason)))


def _answers(
    calls: Mapping[int, tuple], made: Callable[[int], gymnasium.Env], space: Any, memory: Any
) -> dict[int, Any]:
    """What methods return; of a step or a start the info, as the rest is shown."""
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
    """What `step` returns; as much of an episode that starts or continues."""
    if name == "step":
        return env.step(argument)
    ended, options = False, {"variation": argument}
    if name == "restore":
        ended = argument.ended
        options = {"state": (argument, env.np_random.bit_generator.state)}
    observation, info = env.reset(options=options)
    return observation, 0.0, False, ended, info
