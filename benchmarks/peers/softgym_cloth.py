"""The package's batch solver of cloth, with its own settings: 25 substeps per step of 10 ms."""

from typing import Any

import numpy as np

from benchmarks.peers.scene import Scene
from softgym_mj.batch.device import CpuDevice, Device
from softgym_mj.cloth import batch_solver
from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import PARTICLE_SPACING, Cloth

HOLDS_ONLY = -1  # Grippers without a sphere.


class SoftGymCloth:
    """A `Simulation` by `ClothBatchSolver`; grippers without spheres hold the corners."""

    substeps = 25

    def __init__(self, scene: Scene, num_envs: int, device: str):
        """Compiles the model; `device` is "cpu" or "cuda"."""
        self._device: Device = CpuDevice()
        self._cuda: Any = None
        if device == "cuda":
            import torch

            from softgym_mj.batch.gpu import CudaDevice

            self._device, self._cuda = CudaDevice(), torch.cuda
        dims = [
            round((n - 1) * scene.spacing / PARTICLE_SPACING) + 1
            for n in (scene.columns, scene.rows)
        ]
        cloth, arena = Cloth(dims=(dims[0], dims[1]), fabric=scene.fabric), Arena()
        if cloth.shape != (scene.rows, scene.columns):
            raise ValueError(f"the package has no cloth of {scene.rows} x {scene.columns} vertices")
        arena.attach(cloth)
        model = arena.compile(cloth.timestep, cloth).model.ptr
        self.settings: dict[str, Any] = {"precision": "float32, state float64"}
        held = len(scene.held)
        described = batch_solver.describe(model, [HOLDS_ONLY] * held)
        self._solver = batch_solver.ClothBatchSolver(num_envs, scene.num_points, held, self._device)
        for i in range(num_envs):
            self._solver.start(i, described)
        starts = scene.starts(num_envs)
        self._origin = cloth.origin
        self._start = self._device.put(starts - cloth.origin)
        self._goals = self._device.put(starts[:, scene.held])
        self._corners = self._device.put(np.tile(np.array(scene.held, np.int32), (num_envs, 1)))
        self._none = self._device.put(np.full((num_envs, held), -1, np.int32))
        self.restart()
        self.step()  # Compiles the kernel of a GPU.
        self.restart()

    def restart(self) -> None:
        self._solver.qpos[...] = self._start
        self._solver.qvel[...] = 0.0
        self._solver.valid[...] = 0
        self._solver.flags[...] = 0
        self._held = self._corners

    def step(self) -> None:
        self._solver.step(self._goals, self._held, self._goals)

    def wait(self) -> None:
        if self._cuda:
            self._cuda.synchronize()

    def release(self) -> None:
        self._held = self._none

    def positions(self, number: int) -> np.ndarray:
        return self._device.get(self._solver.qpos[:number]) + self._origin

    def peak_memory(self) -> float | None:
        return self._cuda.max_memory_allocated() / 1e9 if self._cuda else None

    def problems(self) -> list[str]:
        flags = self._device.get(self._solver.flags)
        names = "NOT_FINITE", "CANDIDATES_FULL", "PAIRS_FULL", "ROWS_FULL", "COLORS_FULL"
        return [name for name in names if (flags & getattr(batch_solver, name)).any()]
