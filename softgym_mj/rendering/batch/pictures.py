"""`Pictures`: renders the cameras of many environments together."""

import ctypes
import hashlib
from typing import Any

import numpy as np

from softgym_mj.batch.device import ALIGNMENT, Device, function
from softgym_mj.batch.queue import Queue
from softgym_mj.rendering.batch.scenes import Described, textures_of

KIND = "pictures"  # Kind of kernel.
SAMPLES = 2  # Color samples along a side of a pixel.
_COLORS, _SURFACES = 0, 1  # The same values as in scene.h.
_BUSY = 1 << 20  # Work items: enough for all threads of a block.

Array = Any


class Pictures:
    """Renders colors, depths and labels of the cameras of many environments.

    Attributes:
        grown: Number of times that its memory has been replaced by a larger one.
    """

    def __init__(
        self,
        num_envs: int,
        most_points: int,
        num_movers: int,
        num_cameras: int,
        size: tuple[int, int],
        device: Device,
    ):
        """Allocates images.

        Args:
            num_envs: Number of environments.
            most_points: Points of the deformable object in the largest scene.
            num_movers, num_cameras: Numbers of movers and cameras of each scene.
            size: Size of images (height, width) [pixels].
            device: Device that renders.
        """
        self._device, self._size, self._number = device, size, num_envs
        self._slots = min(num_envs, device.max_slots(KIND, _BUSY))
        self._shape = (num_envs, num_cameras, *size)
        self._scenes = device.zeros((num_envs,), "int64")
        self._points = device.zeros((num_envs, most_points, 3), "float64")
        self._poses = device.zeros((num_envs, num_movers, 7), "float64")
        self._queue = Queue(num_envs, device)
        self._colors = device.zeros((*self._shape, 3), "uint8")
        self._distances = device.zeros(self._shape, "float32")
        self._labels = device.zeros(self._shape, "uint8")
        self._known: dict[bytes, tuple[int, Array]] = {}
        self._memory: Array = device.zeros((self._slots, 0), "uint8")
        self._batches: dict[int, Array] = {}
        self.grown = 0

    def load(self, described: Described) -> int:
        """Copies a scene to the device; returns its address."""
        textures = textures_of(scene := described.scene.copy())
        if len(textures):
            textures["texels"] += np.uint64(self._put(described.texels))
        address, whole = self._put(scene), ctypes.c_void_p(scene.ctypes.data)
        size = ctypes.c_longlong()
        sizes = map(ctypes.c_longlong, (*self._size, SAMPLES))
        function(KIND, "memory")(whole, *sizes, ctypes.byref(size))
        needed = -(-size.value // ALIGNMENT) * ALIGNMENT
        if needed > self._memory.shape[1]:
            self._memory = None
            self.grown += 1
            self._memory = self._device.zeros((self._slots, needed), "uint8")
            self._batches.clear()
        return address

    def _put(self, array: np.ndarray) -> int:
        """Returns the device address of bytes; equal bytes share one copy."""
        key = hashlib.sha256(array.tobytes()).digest()
        if key not in self._known:
            there = self._device.put(array)
            self._known[key] = self._device.address(there), there
        return self._known[key][0]

    def colors(self, scenes: Array, points: Array, poses: Array) -> Array:
        """Renders images (num_envs, cameras, height, width, 3) uint8.

        Args:
            scenes: Addresses (num_envs,) from `load`.
            points: Points of deformable objects (num_envs, most_points, 3) [m].
            poses: Positions [m] and quaternions of movers (num_envs, movers, 7).
        """
        self._draw(_COLORS, SAMPLES, scenes, points, poses)
        return self._device.xp.asarray(self._colors, copy=True)

    def surfaces(self, scenes: Array, points: Array, poses: Array) -> tuple[Array, Array]:
        """Renders labels and depths at the centers of pixels; arguments as in `colors`.

        Returns:
            Index into `LABELS` (num_envs, cameras, height, width) uint8, of objects also behind
            glass, and depth along the view (...) float32 [m], of glass first.
        """
        self._draw(_SURFACES, 1, scenes, points, poses)
        xp = self._device.xp
        return xp.asarray(self._labels, copy=True), xp.asarray(self._distances, copy=True)

    def _draw(self, what: int, samples: int, scenes: Array, points: Array, poses: Array) -> None:
        self._scenes[...] = scenes
        self._points[:, : points.shape[1]] = points
        if poses.shape[1]:
            self._poses[...] = poses
        self._queue.plan()
        self._queue.begin()
        if what not in self._batches:
            self._batches[what] = self._written(what, samples)
        self._device.step(KIND, self._batches[what], self._slots, _BUSY)

    def _written(self, what: int, samples: int) -> Array:
        """Returns the struct `Batch` of scene.h as bytes."""
        sizes = (
            self._number, self._slots, self._points.shape[1], self._poses.shape[1],
            self._shape[1], *self._size, samples, what, self._memory.shape[1],
        )  # fmt: skip
        arrays = (
            self._scenes, self._memory, self._points, self._poses,
            *self._queue.arrays, self._colors, self._distances, self._labels,
        )  # fmt: skip
        pointers = [self._device.address(array) for array in arrays]
        return self._device.put(np.array([*sizes, *pointers], np.int64))
