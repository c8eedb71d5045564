"""`Gpu`: a place for worlds on a CUDA device, whose programs are compiled when they are first used.

The programs are those of the library, a block of threads a world. NVIDIA's compiler comes as a
package (cuda-core); what it made is kept in the cache folder.
"""

import hashlib
import logging
import os
import pathlib
import time
from typing import Any

import numpy as np

from softgym_mj.exceptions import InvalidArgumentError, UnavailableError
from softgym_mj.native.places import Copy, Place

THREADS = 256  # Of a block.
BLOCKS = 2  # That each multiprocessor has to have room for.

_FOLDER = pathlib.Path(__file__).parents[1]
_KINDS = ("cloth", "fluid")
_OPTIONS = {
    "std": "c++17",
    "device_as_default_execution_space": True,
    # Arithmetic as the processor's.
    "fma": False, "ftz": False, "prec_div": True, "prec_sqrt": True,
}  # fmt: skip
_NOTICE = "Compiling the %s program for GPUs of architecture %s, once: it takes up to half a minute"
_log = logging.getLogger(__name__)


def _cuda() -> Any:
    """The package that compiles and launches."""
    try:
        import cuda.core
    except ImportError as error:
        raise UnavailableError(
            f"worlds on a GPU need CUDA's packages ({error}): run `pip install softgym_mj[gpu]`"
        ) from error
    return cuda.core


def _source(kind: str) -> str:
    """What a program is compiled of, all of it: the key of the cache."""
    native = _FOLDER / "native"
    files = [*native.glob("*.h"), *(native / "cuda").iterdir(), *(_FOLDER / kind).rglob("*.h")]
    text = "".join(file.read_text() for file in sorted(files))
    return text + (_FOLDER / kind / "batch" / "step.cu").read_text()


def cubin(kind: str, architecture: str, folder: pathlib.Path) -> bytes:
    """The program of worlds of a kind for an architecture, compiled if it is not in the folder.

    Args:
        kind: "cloth" or "fluid".
        architecture: such as "90".
        folder: what has been compiled is kept there.

    Raises:
        UnavailableError: without the packages that compile.
    """
    if kind not in _KINDS:
        raise InvalidArgumentError("kind", kind, _KINDS)
    core = _cuda()
    options = {
        **_OPTIONS,
        "define_macro": [("SGM_THREADS", str(THREADS)), ("SGM_BLOCKS", str(BLOCKS))],
    }
    key = hashlib.sha256(f"{_source(kind)}{sorted(options.items())}".encode()).hexdigest()[:16]
    file = folder / f"{kind}-sm_{architecture}-{key}.cubin"
    if not file.exists():
        _log.warning(_NOTICE, kind, architecture)
        paths = [str(_FOLDER), str(_FOLDER / "native" / "cuda")]
        settings = core.ProgramOptions(arch=f"sm_{architecture}", include_path=paths, **options)
        text = f'#include "{kind}/batch/step.cu"\n'
        start = time.perf_counter()
        code = core.Program(text, "c++", settings).compile("cubin").code
        _log.info("It took %.0f s", time.perf_counter() - start)
        folder.mkdir(parents=True, exist_ok=True)
        whole = file.with_suffix(f".{os.getpid()}")
        whole.write_bytes(code)
        whole.replace(file)
    return file.read_bytes()


class _Stream:
    """PyTorch's stream, as cuda-core wants it."""

    def __init__(self, handle: int):
        self._handle = handle

    def __cuda_stream__(self) -> tuple[int, int]:
        return 0, self._handle


class _Copying(Copy):
    """In memory that a device writes to by itself."""

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


class Gpu(Place):
    """A CUDA device; steps are made in the order of PyTorch's current stream."""

    def __init__(self, folder: pathlib.Path, index: int = 0):
        """Takes a device.

        Args:
            folder: what has been compiled is kept there.
            index: of the device.

        Raises:
            UnavailableError: if there is none, or no PyTorch for it.
        """
        try:
            import torch
        except ImportError as error:
            raise UnavailableError(f"worlds on a GPU need PyTorch: {error}") from error
        if not torch.cuda.is_available():
            raise UnavailableError("there is no CUDA device that PyTorch can use")
        self._torch = torch
        from array_api_compat import torch as xp

        self.xp, self.device = xp, torch.device("cuda", index)
        self._core, self._folder = _cuda(), folder
        self._device = self._core.Device(index)
        self._device.set_current()
        self._programs: dict[str, Any] = {}

    def zeros(self, shape: tuple[int, ...], dtype: str) -> Any:
        return self._torch.zeros(shape, dtype=getattr(self._torch, dtype), device=self.device)

    def put(self, array: np.ndarray) -> Any:
        return self._torch.from_numpy(np.ascontiguousarray(array)).to(self.device)

    def get(self, array: Any) -> np.ndarray:
        return array.cpu().numpy().copy()

    def copy(self, array: Any) -> Copy:
        return _Copying(self._torch, array)

    def address(self, array: Any) -> int:
        return array.data_ptr()

    def step(self, kind: str, batch: Any, num_worlds: int) -> None:
        handle = self._torch.cuda.current_stream(self.device).cuda_stream
        stream = self._device.create_stream(_Stream(handle))
        settings = self._core.LaunchConfig(grid=num_worlds, block=THREADS)
        self._core.launch(stream, settings, self._program(kind), batch.data_ptr())

    def _program(self, kind: str) -> Any:
        if kind not in self._programs:
            major, minor = self._torch.cuda.get_device_capability(self.device)
            code = cubin(kind, f"{major}{minor}", self._folder)
            program = self._core.ObjectCode.from_cubin(code).get_kernel("Step")
            self._programs[kind] = program
        return self._programs[kind]
