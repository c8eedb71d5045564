"""Executors of independent calls: this process, worker processes, or a Ray cluster.

The results do not depend on the executor. If a worker is lost, another one repeats its calls; each
result is used once.
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

MOST_PROCESSES = 512  # Each needs about 0.1 GiB.
_HAS_MASKS = hasattr(signal, "pthread_sigmask")
MAX_LOSSES = 3  # Pools lost in a row without a result; after that the call itself is the cause.


class Executor(contextlib.AbstractContextManager["Executor"]):
    """Computes calls in parallel; a context manager that closes its workers.

    Attributes:
        number: Number of calls that run at the same time.
    """

    number: int

    @abc.abstractmethod
    def results(
        self, function: Callable, calls: Sequence[tuple[Any, ...]]
    ) -> Iterator[tuple[int, Any]]:
        """Runs calls; yields (index, result) of each as soon as it has finished.

        An error in a call is raised after the calls already running have been yielded.

        Args:
            function: Function of a module, so that other processes can import it.
            calls: Positional arguments of each call, picklable.

        Raises:
            SimulationError: if workers are lost repeatedly.
        """

    def all(self, function: Callable, calls: Sequence[tuple[Any, ...]]) -> list[Any]:
        """Returns the results of calls, in their order."""
        result = dict(self.results(function, calls))
        return [result[index] for index in range(len(calls))]

    def close(self) -> None:
        """Stops the workers, if there are any, after their current calls."""

    def __exit__(self, *error):
        self.close()


class SerialExecutor(Executor):
    """Executor that computes one call after the other in this thread."""

    number = 1

    def results(self, function, calls):
        for index, call in enumerate(calls):
            yield index, function(*call)


class BatchExecutor(Executor):
    """Executor of a batched function, which maps a list of calls to the list of their results."""

    number = 1

    def __init__(self, most: int):
        """Sets the maximum number of calls in a batch."""
        self._most = most

    def results(self, function, calls):
        for first in range(0, len(calls), self._most):
            yield from enumerate(function(calls[first : first + self._most]), first)


class ProcessExecutor(Executor):
    """Executor with worker processes, which end with their parent, even if it is killed."""

    def __init__(self, number: int):
        """Sets the number of processes, 1..`MOST_PROCESSES`; they start with the first call."""
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
                        "(killed, or out of memory?); finished results are stored"
                    ) from error

    def _once(self, function, calls: Mapping[int, tuple]) -> Iterator[tuple[int, Any]]:
        """Computes calls by index until a process is lost."""
        if self._pool is None:
            # Spawn: a forked child would share the locks and OpenGL contexts of its parent.
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
                    yield futures.pop(future), future.result()
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
    """Executor on the cores of a Ray cluster, which repeats the calls of lost workers."""

    def __init__(self, address: str | None = None, number: int | None = None):
        """Connects to a cluster.

        Args:
            address: Address of a running cluster, or "auto" for this machine's; None starts one of
                `number` cores (None: all) on this machine.
            number: Number of cores of a new cluster.
        """
        self._ray = ray = import_extra("ray", "Ray", "cluster")
        self._mine = not ray.is_initialized()
        if self._mine:
            cores = None if address else number
            ray.init(address, num_cpus=cores, include_dashboard=False, log_to_driver=False)
        # -1 repeats without limit when a worker is lost; errors of the call itself are not retried.
        self._call = ray.remote(max_retries=-1, retry_exceptions=False)(_call)

    @property
    def number(self) -> int:  # type: ignore[override]
        """Current number of cores of the cluster."""
        return max(1, int(self._ray.cluster_resources().get("CPU", 1)))

    def results(self, function, calls):
        waiting: Iterator[tuple[int, tuple[Any, ...]]] = enumerate(calls)
        index: dict[Any, int] = {}
        failure: Exception | None = None
        try:
            while True:
                # Calls are submitted only to free cores: canceling a queued call could interrupt
                # one that has just started.
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
            for reference in index:  # Their results are no longer needed.
                with contextlib.suppress(self._ray.exceptions.RayError):
                    self._ray.cancel(reference)
        if failure is not None:
            raise failure

    def close(self):
        if self._mine:
            self._ray.shutdown()


def make_executor(jobs: int = 1, ray: str | None = None) -> Executor:
    """Returns the executor of a number of workers.

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
    """Delays Ctrl-C: a worker that is interrupted while it starts would print a traceback.

    Processes that start meanwhile inherit the signal mask of this thread until `_start`. Without
    signal masks (Windows) and in other threads nothing is delayed.
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
    """Makes a worker end silently at Ctrl-C, and when its parent is killed."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if _HAS_MASKS:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])

    def watch():
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
