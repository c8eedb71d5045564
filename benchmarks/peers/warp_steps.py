"""`WarpSteps`: what the simulations by Warp share."""

import abc
from typing import Any

import warp as wp


class WarpSteps(abc.ABC):
    """A `Simulation` by Warp, whose steps on a GPU are launches of one CUDA graph."""

    _graph: Any = None

    @abc.abstractmethod
    def restart(self) -> None:
        """Puts all environments at the start."""

    @abc.abstractmethod
    def _steps(self) -> None:
        """Launches the substeps of a step."""

    def capture(self) -> None:
        """Compiles the kernels and captures a step; ends at the start."""
        self.restart()
        self._steps()  # Compiles the kernels.
        if wp.get_device().is_cuda:
            with wp.ScopedCapture() as capture:
                self._steps()
            self._graph = capture.graph
        self.restart()

    def step(self) -> None:
        if self._graph is None:
            self._steps()
        else:
            wp.capture_launch(self._graph)

    def wait(self) -> None:
        wp.synchronize_device()

    def peak_memory(self) -> float | None:
        if not wp.get_device().is_cuda:
            return None
        return wp.get_mempool_used_mem_high(wp.get_device()) / 1e9
