"""`CudaGraph`: a repeated function as a CUDA graph.

Launches of kernels dominate updates of small networks; a graph launches all kernels at once.
"""

from collections.abc import Callable, Sequence

import torch
from torch import Tensor

_WARM_UP = 3  # Calls before the capture, which allocate, for example, states of optimizers.


class CudaGraph:
    """Repeats a function that changes arrays in place, as a CUDA graph if there is a GPU."""

    def __init__(
        self, function: Callable[[], dict[str, Tensor]], sources: Sequence[torch.Generator]
    ):
        """Sets the function.

        Args:
            function: Reads and writes arrays at fixed addresses without copies to the host; its
                result is valid until the next call.
            sources: Generators of its random numbers, all on one device.
        """
        self._function, self._sources = function, sources
        self._on_gpu = sources[0].device.type == "cuda"
        self._calls = 0
        self._graph: torch.cuda.CUDAGraph | None = None
        self._result: dict[str, Tensor] = {}

    def __call__(self) -> dict[str, Tensor]:
        """Calls the function and returns its result."""
        self._calls += 1
        if not self._on_gpu:
            return self._function()
        if self._calls <= _WARM_UP:
            # Warm-up calls run on a separate stream, as the capture does.
            side = torch.cuda.Stream()
            side.wait_stream(torch.cuda.current_stream())
            with torch.cuda.stream(side):
                result = self._function()
            torch.cuda.current_stream().wait_stream(side)
            return result
        if self._graph is None:
            self._graph = torch.cuda.CUDAGraph()
            for source in self._sources:
                self._graph.register_generator_state(source)
            with torch.cuda.graph(self._graph, capture_error_mode="thread_local"):
                self._result = self._function()
        self._graph.replay()
        return self._result
