"""Arrays of NumPy and PyTorch as arrays of JAX and back, without copies through the host."""

import os
from collections.abc import Mapping
from typing import Any

import jax
import numpy as np

from softgym_mj.exceptions import UnavailableError


def device_like(array: Any) -> jax.Device:
    """Returns JAX's device that stores an array of NumPy or PyTorch.

    Raises:
        UnavailableError: if JAX cannot use it.
    """
    kind = "cpu" if isinstance(array, np.ndarray) else array.device.type
    # By default, JAX takes three quarters of a GPU's memory at its start.
    os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")
    try:
        return jax.devices(kind)[0]
    except RuntimeError as error:
        raise UnavailableError(
            f"arms on a GPU need JAX with CUDA ({error}): pip install 'jax[cuda13]'"
        ) from error


def to_jax(array: Any, device: jax.Device) -> jax.Array:
    """Returns an array of JAX with the values of `array`, of a tensor in memory of its own.

    JAX records its programs as CUDA graphs, which cannot be updated from its memory to PyTorch's.
    """
    if isinstance(array, (np.ndarray, jax.Array)):
        return jax.device_put(array, device)
    return jax.numpy.copy(jax.dlpack.from_dlpack(array))


def shared(arrays: Any, device: jax.Device) -> Any:
    """Returns nested arrays by `to_jax`."""
    return jax.tree.map(lambda array: to_jax(array, device), arrays)


def put(into: Mapping[str, Any], found: Mapping[str, jax.Array]) -> None:
    """Copies arrays of JAX into arrays of NumPy or PyTorch with their names."""
    for name, array in found.items():
        whole = into[name]
        whole[...] = like(whole, array).reshape(whole.shape)


def like(array: Any, found: jax.Array) -> Any:
    """Returns a read-only array of JAX as one of the library of `array`; they share memory."""
    if isinstance(array, np.ndarray):
        return np.asarray(found)
    import torch

    return torch.from_dlpack(found)
