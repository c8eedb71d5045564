"""`Solver`: predicts the motion in recorded experiments."""

from typing import Protocol, TypeVar

import numpy as np

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
