"""`WorkerPool`: worker processes whose calls an interrupt cannot tear apart."""

import contextlib
import functools
import os
import pickle
import queue
import threading
import weakref
from collections.abc import Callable, Mapping
from multiprocessing.connection import Connection
from typing import Any

import cloudpickle

from softgym_mj.exceptions import LifecycleError, SimulationError
from softgym_mj.parallel.scripts import unknown_main
from softgym_mj.vector.worker import END, serve

# [s] That workers have to finish a call whose answer nobody waits for; one may be stuck.
PATIENCE = 5.0
# [s] After which a waiting thread looks for signals: one that comes just before it goes to sleep
# does not wake it.
_GLANCE = 0.5


class WorkerPool:
    """Pool of processes that answer messages.

    A separate thread communicates with them, because signals such as Ctrl-C are raised in the main
    thread: there they would leave half a message in a pipe, or an answer that the next call would
    mistake for its own.
    """

    def __init__(self, context: Any, number: int, *arguments: Any):
        """Starts the processes and waits until they are running.

        Args:
            context: Start method, from `multiprocessing.get_context`.
            number: Number of processes.
            *arguments: Arguments of `serve`, from `make` on.
        """
        self._pipes: list[Connection] = []
        processes: list[Any] = []
        try:
            for _ in range(number):
                here, there = context.Pipe()
                ends = there, here, dict(os.environ)
                process = context.Process(target=serve, args=(*ends, *arguments), daemon=True)
                with unknown_main():
                    process.start()
                there.close()
                self._pipes.append(here)
                processes.append(process)
            self._jobs: queue.SimpleQueue = queue.SimpleQueue()
            # After the processes: a fork takes no other thread along.
            self._thread = threading.Thread(
                target=_work, args=(self._jobs, self._pipes, processes), daemon=True
            )
            self._thread.start()
        except BaseException:
            for process in processes:
                process.kill()
            raise
        self._owner = os.getpid()
        self._end = weakref.finalize(self, _end, self._jobs, self._thread, processes, self._owner)
        self.begin(self.ask, {i: {} for i in range(number)})()

    def begin(self, function: Callable[..., Any], *args: Any) -> Callable[[], Any]:
        """Runs a function to its end, even if the caller is interrupted.

        Returns:
            A function that waits for the result and returns it, once.

        Raises:
            LifecycleError: After `close()`, and in a fork of the process that made the pool.
        """
        if not self._end.alive:
            raise LifecycleError("this vector environment was closed: make a new one")
        if os.getpid() != self._owner:
            raise LifecycleError(
                "this vector environment was made before this process was forked: make a new one"
            )
        result: queue.SimpleQueue = queue.SimpleQueue()
        self._jobs.put((function, args, result))  # In one piece: it is not written in Python.
        return functools.partial(_waited, result)

    def ask(self, messages: Mapping[int, Any]) -> dict[int, Any]:
        """Sends messages to workers and returns their answers; only `begin` may call it.

        Args:
            messages: Messages of `serve` by index of the worker.

        Returns:
            Answers by index of the worker.

        Raises:
            SimulationError: If a worker has ended. Otherwise the first error of a worker.
        """
        # Before the first is sent: what cannot be pickled is sent to nobody.
        pickled = {i: cloudpickle.dumps(message) for i, message in messages.items()}
        for i, message in pickled.items():
            with contextlib.suppress(ConnectionError):  # A lost one does not answer, either.
                self._pipes[i].send_bytes(message)
        lost, replies = [], {}
        for i in messages:
            try:
                replies[i] = self._pipes[i].recv_bytes()
            except (EOFError, ConnectionError):
                lost.append(i)
        if lost:
            raise SimulationError(
                f"worker {lost[0]} of a vector environment has ended (killed, or out of memory?): "
                "make a new one"
            )
        answers = {}
        for i, reply in replies.items():
            succeeded, answers[i] = pickle.loads(reply)
            if not succeeded:
                raise answers[i]
        return answers

    def close(self) -> None:
        """Ends the processes, after their current call unless it takes too long."""
        self._end()


def _waited(result: queue.SimpleQueue) -> Any:
    """Returns the value from a queue; raises an error from the queue, or that of a signal."""
    outcome = None
    while outcome is None:
        with contextlib.suppress(queue.Empty):
            outcome = result.get(timeout=_GLANCE)
    succeeded, value = outcome
    if succeeded:
        return value
    try:
        raise value
    finally:
        del outcome, value  # Its traceback has this frame: together they would keep the pool alive.


def _work(jobs: queue.SimpleQueue, pipes: list[Connection], processes: list[Any]) -> None:
    """Carries out jobs one after the other, then ends the processes."""
    while (job := jobs.get()) is not None:
        function, args, result = job
        try:
            outcome = True, function(*args)
        except BaseException as error:
            outcome = False, error
        # Before the caller goes on: they would keep the environment alive.
        del job, function, args
        result.put(outcome)
        del result, outcome
    for pipe in pipes:
        with contextlib.suppress(ConnectionError):  # One that has ended already.
            pipe.send_bytes(END)
        pipe.close()
    for process in processes:
        process.join()


def _end(
    jobs: queue.SimpleQueue, thread: threading.Thread, processes: list[Any], owner: int
) -> None:
    """Ends a pool that is closed or unused, at the latest when Python exits."""
    if os.getpid() != owner:  # A fork has no such thread, and the processes are not its own.
        return
    jobs.put(None)
    if thread is threading.current_thread():
        return
    thread.join(PATIENCE)
    if thread.is_alive():
        for process in processes:
            process.kill()
        thread.join()
