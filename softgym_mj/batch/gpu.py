"""`CudaDevice`: a CUDA device for batches; its kernels are compiled at their first use.

The kernels are those of the library; a block of threads steps an environment. NVIDIA's compiler
comes as a package (cuda-core); its output is kept in the cache folder.
"""

import contextlib
import functools
import hashlib
import logging
import pathlib
import time
import warnings
from collections.abc import Callable, Hashable, Mapping
from typing import Any

import numpy as np

from softgym_mj.batch.device import Copy, Device
from softgym_mj.exceptions import StoreError, UnavailableError, check_name, install_extra
from softgym_mj.native.caches import ADVICE, cache_folder
from softgym_mj.storage.files import write_whole

# Ends of the names of variants: cloth and rope with solids, also with meshes and heightfields, and
# water that pushes walls.
SOLIDS, GRIDS, PUSHES = "_solids", "_grids", "_pushes"
# Folder, entry file and macros of each kernel; all other code is in headers.
KERNELS: dict[str, tuple[str, str, Mapping[str, str]]] = {
    "cloth": ("cloth", "cloth/batch/step.cu", {"SGM_SOLIDS": "0"}),
    f"cloth{SOLIDS}": ("cloth", "cloth/batch/step.cu", {"SGM_GRIDS": "0"}),
    f"cloth{GRIDS}": ("cloth", "cloth/batch/step.cu", {}),
    "fluid": ("fluid", "fluid/batch/step.cu", {"SGM_PUSHES": "0"}),
    f"fluid{PUSHES}": ("fluid", "fluid/batch/step.cu", {}),
    "measures": ("batch", "batch/measures.cu", {}),
    "pictures": ("rendering", "rendering/batch/draw.cu", {}),
}
# Largest number of threads per block, and blocks per multiprocessor: the fastest on an H100.
BLOCKS = {"cloth": (256, 4), "fluid": (1024, 1), "measures": (256, 1), "pictures": (256, 4)}
# Kinds whose largest blocks step two small environments by halves (queue.h).
HALVED = {"fluid"}
# [bytes] Shared memory per point, as in cloth/batch/host.h, and its limit per block.
QUICK, MOST_QUICK = {"cloth": 48, "fluid": 0, "pictures": 0}, 48 * 1024

_WARP = 32  # Threads of a warp.
_FOLDER = pathlib.Path(__file__).parents[1]
_OPTIONS = {
    "std": "c++17",
    "device_as_default_execution_space": True,
    # The same floating-point arithmetic as on the CPU.
    "fma": False, "ftz": False, "prec_div": True, "prec_sqrt": True,
}  # fmt: skip
_NOTICE = "Compiling the kernel of %s for GPUs of architecture %s, once: up to half a minute"
_log = logging.getLogger(__name__)


def _core() -> Any:
    """Returns the package cuda.core, which compiles and launches kernels."""
    try:
        import cuda.core
    except ImportError as error:
        raise UnavailableError(
            f"environments on a GPU need CUDA's packages ({error}): {install_extra('gpu')}"
        ) from error
    return cuda.core


def _source(package: str, file: str) -> str:
    """Returns the complete source of a kernel, from which the cache key is computed."""
    folders = (_FOLDER / name for name in ("native", "batch", package))
    headers = (each for folder in folders for each in folder.rglob("*.h"))
    files = {*headers, *(_FOLDER / "batch" / "cuda").iterdir()}
    return "".join(each.read_text() for each in [*sorted(files), _FOLDER / file])


def compiled(name: str, architecture: str) -> bytes:
    """Returns the binary of a kernel for an architecture such as "90"; compiles it if not cached.

    Warns if the cache cannot be written.

    Raises:
        UnavailableError: If CUDA's Python packages are not installed.
    """
    check_name("name", name, KERNELS)
    core, (package, file, own) = _core(), KERNELS[name]
    kind = name.partition("_")[0]
    threads, blocks = BLOCKS[kind]
    macros = [("SGM_THREADS", str(threads)), ("SGM_BLOCKS", str(blocks)), *own.items()]
    macros += [("SGM_HALVES", "1")] * (kind in HALVED)
    settings = {**_OPTIONS, "define_macro": macros}
    key = hashlib.sha256(f"{_source(package, file)}{settings}".encode()).hexdigest()[:16]
    check_name("architecture", architecture, _architectures())
    kept = cache_folder() / "kernels" / f"{name}-sm_{architecture}-{key}.cubin"
    with contextlib.suppress(OSError):
        return kept.read_bytes()
    _log.info(_NOTICE, name, architecture)
    paths = [str(_FOLDER), str(_FOLDER / "batch" / "cuda")]
    options = core.ProgramOptions(arch=f"sm_{architecture}", include_path=paths, **settings)
    start = time.perf_counter()
    code = core.Program(f'#include "{file}"\n', "c++", options).compile("cubin").code
    _log.info("It took %.0f s", time.perf_counter() - start)
    try:
        write_whole(kept, code)
    except StoreError as error:
        warnings.warn(f"{error}. {ADVICE}", stacklevel=2)
    return code


@functools.cache
def _architectures() -> tuple[str, ...]:
    """Returns the architectures that NVIDIA's compiler supports, such as "90"."""
    from cuda.bindings import nvrtc

    _, known = nvrtc.nvrtcGetSupportedArchs()
    return tuple(map(str, known))


@functools.cache
def _loaded(name: str, device: Any) -> tuple[Any, Any]:
    """Returns a cuda-core device and a kernel loaded on it."""
    import torch

    core = _core()
    own = core.Device(device.index)
    own.set_current()
    major, minor = torch.cuda.get_device_capability(device)
    return own, core.ObjectCode.from_cubin(compiled(name, f"{major}{minor}"))


@functools.cache
def _entry(name: str, entry: str, device: Any) -> tuple[Any, Any]:
    """A device of cuda-core, and an entry of a program."""
    own, code = _loaded(name, device)
    return own, code.get_kernel(entry)


class _Stream:
    """PyTorch's CUDA stream with cuda-core's stream protocol."""

    def __init__(self, handle: int):
        self._handle = handle

    def __cuda_stream__(self) -> tuple[int, int]:
        return 0, self._handle


def launch(
    name: str, entry: str, device: Any, blocks: int, threads: int, *numbers: int, quick: int = 0
) -> None:
    """Launches a kernel on PyTorch's current stream.

    Args:
        name, entry: Name of the kernel and its entry function.
        device: PyTorch device.
        blocks, threads: Number of blocks, and of threads per block.
        numbers: Arguments of the entry: integers or addresses.
        quick: Shared memory of a block [bytes].
    """
    import torch

    own, kernel = _entry(name, entry, device)
    stream = own.create_stream(_Stream(torch.cuda.current_stream(device).cuda_stream))
    settings = _core().LaunchConfig(grid=blocks, block=threads, shmem_size=quick)
    _core().launch(stream, settings, kernel, *numbers)


class _Copying(Copy):
    """Copy into pinned memory."""

    def __init__(self, torch: Any, array: Any):
        self._to = torch.empty(array.shape, dtype=array.dtype, pin_memory=True)
        self._to.copy_(array, non_blocking=True)
        self._event = torch.cuda.Event()
        self._event.record()

    @property
    def done(self) -> bool:  # type: ignore[override]
        return self._event.query()

    def wait(self) -> np.ndarray:
        self._event.synchronize()
        return self._to.numpy()


class CudaDevice(Device):
    """CUDA device; steps run in order on PyTorch's current stream."""

    def __init__(self):
        """Opens the first CUDA device.

        Raises:
            UnavailableError: If there is no such device, or PyTorch cannot use it.
        """
        try:
            import torch
            from array_api_compat import torch as xp
        except ImportError as error:
            raise UnavailableError(
                f"environments on a GPU need PyTorch ({error}): {install_extra('gpu')}"
            ) from error
        if not torch.cuda.is_available():
            raise UnavailableError(
                "there is no CUDA device that PyTorch can use; device='cpu' and 'host' need none"
            )
        self._torch, self.xp, self.xp_device = torch, xp, torch.device("cuda", 0)
        self._graphs: dict[str, tuple[Any, Any, Any]] = {}  # Keys, graphs, results.

    def max_slots(self, kind: str, size: int) -> int:
        return self._resident(kind, size) * (1 + _halved(kind, size))

    def _resident(self, kind: str, size: int) -> int:
        """Number of blocks that run at a time."""
        properties = self._torch.cuda.get_device_properties(self.xp_device)
        threads, blocks = BLOCKS[kind]
        return properties.multi_processor_count * (blocks * threads // _threads(kind, size))

    def zeros(self, shape: tuple[int, ...], dtype: str) -> Any:
        return self._torch.zeros(shape, dtype=getattr(self._torch, dtype), device=self.xp_device)

    def put(self, array: np.ndarray) -> Any:
        here = self._torch.from_numpy(np.ascontiguousarray(array))
        return here.pin_memory().to(self.xp_device, non_blocking=True)

    def get(self, array: Any) -> np.ndarray:
        return array.cpu().numpy().copy()

    def copy(self, array: Any) -> Copy:
        return _Copying(self._torch, array)

    def address(self, array: Any) -> int:
        return array.data_ptr()

    def step(self, kind: str, batch: Any, num_slots: int, size: int, variant: str = "") -> None:
        threads = _threads(kind, size)
        quick = QUICK[kind] * (size + _WARP)
        quick = quick if quick <= MOST_QUICK else 0
        address = batch.data_ptr()
        name = kind + variant
        num_blocks = min(num_slots, self._resident(kind, size))
        launch(name, "Step", self.xp_device, num_blocks, threads, address, quick, quick=quick)

    def repeat(self, key: Hashable, function: Callable[[], Any], name: str = "") -> Any:
        """Runs a function; from its second call with a key on, replays it as a CUDA graph."""
        torch = self._torch
        known, graph, found = self._graphs.get(name, (None, None, None))
        if name not in self._graphs or known != key:  # The first call allocates.
            self._graphs[name] = key, None, None
            return function()
        if graph is None:
            graph = torch.cuda.CUDAGraph()
            with torch.cuda.graph(graph, capture_error_mode="thread_local"):
                found = function()
            self._graphs[name] = key, graph, found
        graph.replay()
        return _cloned(found)


def _threads(kind: str, size: int) -> int:
    """Returns the number of threads of a block for `size` points."""
    most = BLOCKS[kind][0]
    threads = min(max(-(-size // _WARP), 2) * _WARP, most)
    return most if kind in HALVED and threads > most // 2 else threads


def _halved(kind: str, size: int) -> bool:
    """Whether blocks for `size` points may step two environments by halves."""
    return kind in HALVED and _threads(kind, size) == BLOCKS[kind][0]


def _cloned(values: Any) -> Any:
    """Copies tensors in dicts and tuples."""
    if isinstance(values, dict):
        return {name: _cloned(value) for name, value in values.items()}
    if isinstance(values, tuple):
        return tuple(_cloned(value) for value in values)
    return values.clone()
