"""What all engines are given: a mesh, a fabric in SI units, where it starts, what is held."""

import dataclasses
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from softgym_mj.entities.sheet import Fabric
from softgym_mj.reality.meshes import Mesh, rectangle

STEP = 0.01  # [s] Engines make as many steps of their own in it as they need.
GRAVITY = 9.81  # [m/s^2]
SIDE, SPACING = 20, 0.03  # Vertices a side, [m].
SHEET = rectangle((SIDE - 1) * SPACING, (SIDE - 1) * SPACING, SPACING)

# The tablecloth of the tasks, as far as all engines can be given it: no air, and one friction: that
# between layers, 0.75, which is SoftGym's, too.
FABRIC = dataclasses.replace(Fabric(), drag=0.0, friction=Fabric().layer_friction)


class Simulation(Protocol):
    """A sheet in one engine."""

    def positions(self) -> np.ndarray:
        """Vertices (n, 3) [m]."""

    def hold(self, vertices: np.ndarray) -> None:
        """Holds vertices (k,) where they are, and no others."""

    def step(self, targets: np.ndarray) -> None:
        """Steps by `STEP`, and held vertices evenly to targets (k, 3) [m]."""

    def close(self) -> None:
        """Gives back what the engine has of it."""


# Of a mesh, a fabric, where vertices start (n, 3) [m], gravity (3,) [m/s^2], and whether there is a
# floor at the height 0.
Build = Callable[[Mesh, Fabric, np.ndarray, np.ndarray, bool], Simulation]


@dataclasses.dataclass(frozen=True)
class Engine:
    """One way to simulate.

    Attributes:
        name: of its own.
        title: for tables.
        build: makes a simulation.
        settings: whatever else decides what comes out, JSON-able.
    """

    name: str
    title: str
    build: Build
    settings: dict[str, Any]


def down(scale: float = 1.0) -> np.ndarray:
    """Gravity (3,) [m/s^2] along -Z, a multiple of the earth's."""
    return np.array([0.0, 0.0, -GRAVITY * scale])
