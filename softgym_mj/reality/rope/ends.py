"""Ends of rods: how they are held, and how they move."""

import dataclasses
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation


@dataclasses.dataclass(frozen=True)
class Motion:
    """Motion of a clamped end relative to its start; linear between times, constant afterwards.

    Attributes:
        times: (m,) [s], from 0 on.
        displacement: (m, 3) [m].
        rotation: (m, 3) rotation vectors about the end's start [rad].
    """

    times: np.ndarray
    displacement: np.ndarray
    rotation: np.ndarray

    def poses(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns displacements (s, 3) [m] and rotations (s, 3, 3) at times (s,) [s]."""
        moved, turned = (
            np.stack([np.interp(times, self.times, column) for column in values.T], axis=1)
            for values in (self.displacement, self.rotation)
        )
        return moved, Rotation.from_rotvec(turned).as_matrix()


AT_REST = Motion(np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3)))


@dataclasses.dataclass(frozen=True)
class End:
    """End of a rod.

    Attributes:
        held: "pinned" holds the position, "clamped" also the direction and the material frame.
        motion: Motion of a clamped end.
        slide: Unit vector (3,) along which a clamped end slides without friction; None for none.
            It is the direction of the rod at this end, which is not displaced and turns about it.
        force: Force (3,) on the end [N].
    """

    held: Literal["free", "pinned", "clamped"] = "free"
    motion: Motion = AT_REST
    slide: np.ndarray | None = None
    force: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))

    @property
    def is_clamped(self) -> bool:
        """Whether the direction and the material frame are held."""
        return self.held == "clamped"


def rolls(tangents: np.ndarray, directors: np.ndarray) -> np.ndarray:
    """Returns turns (s,) [rad] of a frame about its tangent, beyond transport without spin.

    Args:
        tangents: Unit vectors (s + 1, 3).
        directors: Unit vectors (s + 1, 3) across them.
    """
    a, b, director = tangents[:-1], tangents[1:], directors[:-1]
    axis = np.cross(a, b)
    carried = director + np.cross(axis, director)
    cosine = np.sum(a * b, axis=1)[:, None]
    carried = carried + np.cross(axis, np.cross(axis, director)) / (1.0 + cosine)
    sine = np.sum(np.cross(carried, directors[1:]) * b, axis=1)
    return np.arctan2(sine, np.sum(carried * directors[1:], axis=1))
