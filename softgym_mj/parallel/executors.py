"""Where independent calls are computed: here, in processes of this machine, or on a Ray cluster.

Whatever the executor, every call is made with the same arguments and its result is used once: a
worker that is lost has its calls made again by another.
"""

import abc
import concurrent.futures
import contextlib
import itertools
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from typing import Any

from softgym_mj.exceptions import SimulationError, check_count, import_extra
from softgym_mj.parallel.scripts import unknown_main

MOST_PROCESSES = 512  # Each takes a tenth of a GiB.
_HAS_MASKS = hasattr(signal, "pthread_sigmask")
MAX_LOSSES = 3  # Pools lost in a row without a single result: then the call itself is to blame.


class Executor(contextlib.AbstractContextManager["Executor"]):
    """Makes calls side by side; a context manager.

    Attributes:
        number: how many calls can be made at the same time.
    """

    number: int

    @abc.abstractmethod
    def results(
        self, function: Callable, calls: Sequence[tuple[Any, ...]]
    ) -> Iterator[tuple[int, Any]]:
        """Makes calls; yields (index, result) of each as soon as it is there.

        The error of a call comes when the calls that had begun are finished and yielded.

        Args:
            function: of a module, so that other processes find it.
            calls: positional arguments of each call, picklable.

        Raises:
            SimulationError: if workers are lost again and again.
        """

    def all(self, function: Callable, calls: Sequence[tuple[Any, ...]]) -> list[Any]:
        """The results of calls, in their order."""
        result = dict(self.results(function, calls))
        return [result[index] for index in range(len(calls))]

    @abc.abstractmethod
    def close(self) -> None:
        """Ends its workers; calls that run are finished."""

    def __exit__(self, *error):
        self.close()


class SerialExecutor(Executor):
    """One call after the other, in this thread."""

    number = 1

    def results(self, function, calls):
        for index, call in enumerate(calls):
            yield index, function(*call)

    def close(self):
        pass


class Together(Executor):
    """Makes many calls by one: a function of a list of calls returns their results."""

    number = 1

    def __init__(self, most: int):
        """Makes at most so many calls at once: what is done is kept after each."""
        self._most = most

    def results(self, function, calls):
        for first in range(0, len(calls), self._most):
            yield from enumerate(function(calls[first : first + self._most]), first)

    def close(self):
        pass


class ProcessExecutor(Executor):
    """Processes on this machine. They end with their parent, even if it is killed."""

    def __init__(self, number: int):
        """Starts `number` processes, 1..`MOST_PROCESSES`, when they are first needed."""
        self.number = check_count("jobs", number, 1, MOST_PROCESSES)
        self._pool: concurrent.futures.ProcessPoolExecutor | None = None

    def results(self, function, calls):
        left, losses = dict(enumerate(calls)), 0
        while left:
            try:
                for index, result in self._once(function, left):
                    del left[index]
                    losses = 0
                    yield index, result
            except BrokenProcessPool as error:
                self._pool = None
                losses += 1
                if losses == MAX_LOSSES:
                    raise SimulationError(
                        f"{losses} times in a row a worker process ended before its first result "
                        "(killed, or out of memory?); what was finished is kept"
                    ) from error

    def _once(self, function, calls: Mapping[int, tuple]) -> Iterator[tuple[int, Any]]:
        """Makes calls by index as long as no process is lost."""
        if self._pool is None:
            # A forked child would share the locks and OpenGL contexts of its parent.
            self._pool = concurrent.futures.ProcessPoolExecutor(
                self.number,
                multiprocessing.get_context("spawn"),
                initializer=_start,
                initargs=(os.getpid(),),
            )
        with _uninterrupted(), unknown_main():
            futures = {self._pool.submit(function, *call): index for index, call in calls.items()}
        failure = None
        try:
            for future in concurrent.futures.as_completed(futures):
                if future.cancelled():
                    continue
                error = future.exception()
                if isinstance(error, BrokenProcessPool):
                    raise error
                if error is None:
                    yield futures[future], future.result()
                else:
                    failure = failure or error
                    _cancel(futures)
        finally:
            _cancel(futures)
        if failure is not None:
            raise failure

    def close(self):
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None


class RayExecutor(Executor):
    """The cores of a Ray cluster. Ray makes the calls of a lost worker or machine again."""

    def __init__(self, address: str | None = None, number: int | None = None):
        """Connects to a cluster.

        Args:
            address: of a running cluster, "auto" for the one that this machine belongs to; None
                starts a cluster of this machine alone.
            number: cores of that new cluster; None for all.

        Raises:
            UnavailableError: if Ray is missing.
        """
        self._ray = ray = import_extra("ray", "Ray", "cluster")
        self._mine = not ray.is_initialized()
        if self._mine:
            cores = None if address else number
            ray.init(address, num_cpus=cores, include_dashboard=False, log_to_driver=False)
        # -1: as often as it takes; an error of the call itself is not tried again.
        self._call = ray.remote(max_retries=-1, retry_exceptions=False)(_call)

    @property
    def number(self) -> int:  # type: ignore[override]
        """Cores of the cluster, which grows and shrinks."""
        return max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    def results(self, function, calls):
        waiting: Iterator[tuple[int, tuple[Any, ...]]] = enumerate(calls)
        index: dict[Any, int] = {}
        failure: Exception | None = None
        try:
            while True:
                # Calls are handed over as cores come free: Ray cannot take back one that waits
                # without interrupting it if it has just begun.
                for place, call in itertools.islice(waiting, max(0, self.number - len(index))):
                    index[self._call.remote(function, call)] = place
                if not index:
                    break
                (done,), _ = self._ray.wait(list(index), num_returns=1)
                place = index.pop(done)
                try:
                    result = self._ray.get(done)
                except self._ray.exceptions.RayTaskError as error:
                    failure = failure or error.as_instanceof_cause()
                    waiting = iter(())
                    continue
                yield place, result
        finally:
            for reference in index:  # Nobody waits for these any more.
                with contextlib.suppress(self._ray.exceptions.RayError):
                    self._ray.cancel(reference)
        if failure is not None:
            raise failure

    def close(self):
        if self._mine:
            self._ray.shutdown()


def make_executor(jobs: int = 1, ray: str | None = None) -> Executor:
    """The executor of a number of workers.

    Args:
        jobs: number of processes; 1 works in this one.
        ray: None; "local" for a Ray cluster of `jobs` cores on this machine, or the address of a
            running cluster.
    """
    check_count("jobs", jobs, 1, MOST_PROCESSES)
    if ray is not None:
        return RayExecutor(None, jobs) if ray == "local" else RayExecutor(ray)
    return SerialExecutor() if jobs == 1 else ProcessExecutor(jobs)


def _cancel(futures: Iterable[concurrent.futures.Future]) -> None:
    for future in futures:
        future.cancel()


def _call(function: Callable, arguments: tuple[Any, ...]) -> Any:
    return function(*arguments)


@contextlib.contextmanager
def _uninterrupted() -> Iterator[None]:
    """Puts Ctrl-C off: half a start of a worker would end in a traceback of it.

    Processes that start meanwhile do not hear of it until `_start`: they have the mask of signals
    of this thread. Where there are none (Windows), and in other threads, nothing is put off.
    """
    if threading.current_thread() is not threading.main_thread() or not _HAS_MASKS:
        yield
        return
    noted: list[tuple] = []
    usual = signal.signal(signal.SIGINT, lambda *received: noted.append(received))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, usual)
        if noted and callable(usual):
            usual(*noted[0])


def _start(parent: int) -> None:
    """Has a worker end at Ctrl-C, without a word, and when its parent was killed."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if _HAS_MASKS:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])

    def watch():
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
