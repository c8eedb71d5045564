"""`SettledWater`: initial states of the water tasks, water at rest in its cup."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from softgym_mj.batch.device import Device
from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cup import Cup, CupSize
from softgym_mj.exceptions import SimulationError
from softgym_mj.fluid import Liquid, Resolution, Water
from softgym_mj.fluid.batch_solver import FluidBatchSolver, describe
from softgym_mj.fluid.water import TIMESTEP
from softgym_mj.tasks.shared.starts.cup_variations import (
    LARGEST_COUNT,
    CupVariation,
    CupVariations,
    num_particles,
)
from softgym_mj.variations.indices import generator

LOOSENESS = 1.05  # Height of the lattice relative to water at rest; it settles by sinking.
NOISE = 0.01  # Noise relative to the spacing: a perfect lattice would be an unstable equilibrium.
SETTLED_RMS = 0.01  # [m/s] Root mean square speed below which water is at rest,
_REST_STEPS = 50  # if it stays so for this many steps (0.5 s): a turning point is not rest.
_MAX_STEPS = 2000


def lattice(size: CupSize, resolution: Resolution, random: np.random.Generator) -> np.ndarray:
    """Returns positions (count, 3) [m] that fill an upright cup at the origin from its floor up.

    The columns are spread evenly, so that each is at least half their distance from a wall.
    """
    count, (columns, rows) = resolution.count, resolution.columns
    pitch = np.array([size.length / columns, size.width / rows, 0.0])
    pitch[2] = LOOSENESS * resolution.spacing**3 / (pitch[0] * pitch[1])
    site = np.arange(count)
    layer, cell = np.divmod(site, columns * rows)
    sites = np.column_stack([cell % columns, cell // columns, layer])
    noise = random.uniform(-NOISE, NOISE, (count, 3)) * resolution.spacing
    corner = [-size.length / 2, -size.width / 2, size.wall / 2]
    return corner + pitch * (sites + 0.5) + noise


@dataclasses.dataclass(frozen=True)
class SettledWater:
    """Water that sinks from a loose lattice in the cup until it rests (docs/softgym.md 3.0).

    SoftGym seeds its compressible fluid at twice its density, and puts back particles that jump
    out.
    """

    cups: CupVariations
    liquid: Liquid
    fidelity: str = "default"

    @property
    def name(self) -> str:
        """Name of the set: that of the cups."""
        return self.cups.name

    @property
    def parameters(self) -> dict[str, object]:
        """Parameters that determine the initial states, except the cups, as a dict."""
        liquid = dataclasses.asdict(self.liquid)
        return {"version": 5, "fidelity": self.fidelity, "liquid": liquid, "timestep": TIMESTEP}

    @property
    def max_points(self) -> int:
        """Largest number of particles in any variation."""
        return num_particles(LARGEST_COUNT, self.fidelity)

    def variation(self, index: int) -> CupVariation:
        """Returns the amount of water and the cups of a variation."""
        return self.cups.variation(index)

    def sizes(self, index: int) -> tuple[Any, ...]:
        """Returns the sizes of the water and of its cups."""
        variation = self.variation(index)
        return (variation.resolution(self.fidelity), *variation.cups)

    def generate(self, index: int) -> np.ndarray:
        """Returns positions (num_particles, 3) [m] relative to the middle of the cup's floor."""
        physics, cup, water = self._scene(index)
        rest = _Rest(f"variation {index} of {self.name}")
        while not rest.has_come(water.velocities()):
            mujoco.mj_step(physics.model.ptr, physics.data.ptr)
        return self._checked(index, cup, water.points())

    def generate_all(self, indices: Sequence[int], device: Device) -> list[np.ndarray]:
        """Returns positions (n, 3) [m] of several variations, simulated on a device.

        They are bit-identical to those of `generate`, which is called for water that exceeds the
        capacity of the device's solver.
        """
        scenes = [self._scene(index) for index in indices]
        most = max(water.num_points for _, _, water in scenes)
        solver = FluidBatchSolver(len(indices), most, 1, device)
        poses = np.zeros((len(indices), 1, 7))
        for i, (physics, cup, water) in enumerate(scenes):
            model = physics.model.ptr
            solver.start(i, describe(model, [model.body(cup.body.full_identifier).id]))
            solver.set_state(i, {"positions": device.put(water.points())})
            poses[i, 0] = *cup.position, *cup.quaternion
        told = device.put(poses)
        found: dict[int, np.ndarray] = {}
        left = {i: _Rest(f"variation {index} of {self.name}") for i, index in enumerate(indices)}
        while left:
            speeds, flags = device.get(solver.velocities), device.get(solver.flags)
            for i in list(left):
                _, cup, water = scenes[i]
                if flags[i]:
                    found[i] = self.generate(indices[i])
                elif left[i].has_come(speeds[i, : water.num_points]):
                    points = device.get(solver.positions[i, : water.num_points])
                    found[i] = self._checked(indices[i], cup, points)
                else:
                    continue
                del left[i]
                solver.models[i] = 0
            solver.step(told)
        return [found[i] for i in range(len(indices))]

    def _scene(self, index: int) -> tuple[Any, Cup, Water]:
        """Returns a cup with its water before it settles."""
        variation = self.variation(index)
        resolution = variation.resolution(self.fidelity)
        cup, water = Cup(variation.cup), Water(self.liquid, resolution)
        arena = Arena("transport_water")
        cup.join(arena)
        arena.attach(water)
        water.confine(cup.body)
        physics = arena.compile(TIMESTEP, cup, water)
        random = generator(f"{self.name}/lattice", index)
        water.set_points(lattice(variation.cup, resolution, random))
        return physics, cup, water

    def _checked(self, index: int, cup: Cup, positions: np.ndarray) -> np.ndarray:
        """Returns positions (n, 3) [m], after checking that all are inside the cup."""
        outside = np.count_nonzero(~cup.inside(positions))
        if outside:
            raise SimulationError(
                f"variation {index} of {self.name} has {outside} of {len(positions)} particles "
                "outside the cup"
            )
        return positions


class _Rest:
    """Detects when water has come to rest."""

    def __init__(self, name: str):
        self._name, self._steps, self._rest = name, 0, 0

    def has_come(self, velocities: np.ndarray) -> bool:
        """Returns whether it rests, given velocities (n, 3) [m/s] once for each sim step."""
        speed = np.sqrt(np.mean(np.sum(velocities**2, axis=1)))
        if self._steps > _MAX_STEPS:
            raise SimulationError(
                f"{self._name} still moves at {speed:.3f} m/s after {_MAX_STEPS} sim steps"
            )
        is_slow = self._steps > 0 and speed < SETTLED_RMS
        self._steps, self._rest = self._steps + 1, self._rest + 1 if is_slow else 0
        return self._rest == _REST_STEPS
