"""`Solver`: predicts the motion in recorded experiments; and the step that simulations make."""

from typing import Protocol, TypeVar

import mujoco
import numpy as np

# MuJoCo resets the simulation and warns if values are bad.
_BAD = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)
Scenario_contra = TypeVar("Scenario_contra", contravariant=True)


class Solver(Protocol[Scenario_contra]):
    """Predicts motion from what a scenario shows of a recording.

    Attributes:
        name: Name in tables.
        models: Effects that it models, such as "bending".
    """

    name: str
    models: tuple[str, ...]

    def predict(self, scenario: Scenario_contra) -> np.ndarray:
        """Returns positions (f, ..., 3) [m] in the frames of a scenario."""


def step(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Simulates a step; returns whether all values are finite."""
    mujoco.mj_step(model, data)
    return not any(data.warning[kind].number for kind in _BAD)
