"""What a worker process of a `VectorEnv` does: it answers calls for its share of environments."""

import functools
import signal
import traceback
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.connection import Connection
from multiprocessing.reduction import ForkingPickler
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.vector.utils import CloudpickleWrapper, concatenate, iterate, write_to_shared_memory

from softgym_mj.exceptions import SoftGymError

END = "end"  # The call that ends a worker.
READY = "ready"  # The call that only says that it has started.


class Share(SyncVectorEnv):
    """The environments of one worker, which start each with its own options."""

    def start(
        self, seeds: Sequence[int | None], options: Sequence[Mapping[str, Any]], mask: np.ndarray
    ) -> tuple[Any, dict[str, Any]]:
        """Resets those that `mask` (n,) bool names; observations and infos as of `reset`."""
        infos: dict[str, Any] = {}
        for i in np.flatnonzero(mask).tolist():
            own = dict(options[i])
            self._env_obs[i], info = self.envs[i].reset(seed=seeds[i], options=own)
            infos = self._add_info(infos, info, i)
            # An episode that is restored after its end is followed by the next one.
            self._autoreset_envs[i] = "state" in own and own["state"][0].ended
        self._observations = concatenate(
            self.single_observation_space, self._env_obs, self._observations
        )
        return self._observations, infos


def serve(
    pipe: Connection,
    other_end: Connection,
    make: CloudpickleWrapper,
    share: slice,
    mode: AutoresetMode,
    shared: Any,
) -> None:
    """Answers calls until it is told to end, or until nobody is left who could.

    Args:
        pipe: brings calls, tuples that start with a name, and takes answers: whether the call
            succeeded, and what it returned or raised.
        other_end: of the pipe, which a fork has, too.
        make: makes an environment.
        share: which of all environments are here.
        mode: what follows the last step of an episode.
        shared: shared memory that takes the observations.
    """
    # Ctrl-C in a terminal goes to every process of a program. Its first one decides what follows.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    other_end.close()
    made = functools.cache(lambda: _make(make, share, mode))
    while True:
        try:
            name, *arguments = pipe.recv()
            if name == END:
                return
            pipe.send_bytes(_pickled(name, *_answered(made, name, arguments, share.start, shared)))
        except (EOFError, ConnectionError):  # The other end has been killed.
            return


def _make(make: Callable[[], gymnasium.Env], share: slice, mode: AutoresetMode) -> Share:
    return Share([make] * (share.stop - share.start), copy=False, autoreset_mode=mode)


def _answered(
    made: Callable[[], Share], name: str, arguments: Sequence[Any], first: int, shared: Any
) -> tuple[bool, Any]:
    """Whether a call succeeds, and its answer or error; the first one makes the environments."""
    try:
        return True, None if name == READY else _answer(made(), name, arguments, first, shared)
    except Exception as error:
        error.add_note(traceback.format_exc())
        return False, error


def _answer(envs: Share, name: str, arguments: Sequence[Any], first: int, shared: Any) -> Any:
    """Makes a call; what it returns besides observations, which go into the shared memory."""
    if name == "call":
        method, args, kwargs = arguments
        return envs.call(method, *args, **kwargs)
    if name == "set_attr":
        return envs.set_attr(*arguments)
    answer: Any
    if name == "reset":
        observations, answer = envs.start(*arguments)
    else:
        observations, *answer = envs.step(*arguments)
    for i, observation in enumerate(iterate(envs.observation_space, observations)):
        write_to_shared_memory(envs.single_observation_space, first + i, observation, shared)
    return answer


def _pickled(name: str, succeeded: bool, answer: Any) -> memoryview:
    """The bytes of an answer, or of an error if it has none."""
    try:
        return ForkingPickler.dumps((succeeded, answer))
    except Exception as error:  # Whatever the answer's own classes raise.
        reason = f"{type(answer).__name__} of {name!r} cannot leave its worker: {error}"
        return ForkingPickler.dumps((False, SoftGymError(reason)))
