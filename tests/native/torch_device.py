"""`TorchDevice`: what a GPU does with PyTorch's tensors, on the processor."""

import numpy as np
import torch
from array_api_compat import torch as xp

from softgym_mj.batch.device import CpuDevice


class TorchDevice(CpuDevice):
    """Like `batch.gpu.CudaDevice`, with the kernels of the processor."""

    xp = xp
    xp_device = torch.device("cpu")

    def zeros(self, shape, dtype):
        return torch.from_numpy(super().zeros(shape, dtype))

    def put(self, array):
        copy = self.zeros(array.shape, array.dtype.name)
        copy[...] = torch.from_numpy(np.asarray(array))
        return copy

    def get(self, array):
        return array.numpy().copy()

    def address(self, array):
        return array.data_ptr()

    def step(self, kind, batch, num_envs, size, variant=""):
        super().step(kind, batch.numpy(), num_envs, size, variant)
