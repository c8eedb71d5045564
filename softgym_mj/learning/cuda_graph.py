"""`CudaGraph`: what is done again and again, as one of CUDA's graphs where there is a GPU.

Small networks wait for launches: a graph launches all of an update at once.
"""

from collections.abc import Callable, Sequence

import torch
from torch import Tensor

_WARM_UP = 3  # Calls that make what is made once, such as the state of optimizers.


class CudaGraph:
    """A function without arguments that changes arrays in place."""

    def __init__(
        self,
        function: Callable[[], dict[str, Tensor]],
        sources: Sequence[torch.Generator],
    ):
        """Takes a function.

        Args:
            function: reads and writes arrays that stay where they are, and asks for none of their
                numbers; what it returns is read before the next call.
            sources: of the random numbers that it draws, all on one device.
        """
        self._function, self._sources = function, sources
        self._on_gpu = sources[0].device.type == "cuda"
        self._calls = 0
        self._graph: torch.cuda.CUDAGraph | None = None
        self._result: dict[str, Tensor] = {}

    def __call__(self) -> dict[str, Tensor]:
        """What the function returns."""
        self._calls += 1
        if not self._on_gpu:
            return self._function()
        if self._calls <= _WARM_UP:
            # On a stream of its own, as the graph will be.
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
