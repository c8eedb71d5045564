"""Expert of DropCloth: swings the cloth forward and back and releases it when it is stretched out.

The cloth trails behind while the grippers move towards +X and swings forward when they turn back.
It is released when its lower edge moves towards +X and the held edge towards -X. The parameters
come from random search on training variations.
"""

import dataclasses
from collections.abc import Iterator

import numpy as np

from softgym_mj.policies.experts.picker_expert import CLOSED, OPEN, PickerExpert
from softgym_mj.robots.picker import Picker


@dataclasses.dataclass(frozen=True)
class Swing:
    """Parameters of the swing.

    Attributes:
        start: X of the grippers before the swing [m].
        clearance: Height of the lower edge above the floor there, if the workspace allows [m].
        forward, forward_speed: Distance [m] and fraction of full speed towards +X.
        back, back_speed: Distance [m] and fraction of full speed on the way back.
        sinking: Fraction of full speed downwards on the way back.
    """

    start: float
    clearance: float
    forward: float
    forward_speed: float
    back: float
    back_speed: float
    sinking: float


PICKER_SWING = Swing(-0.066, 0.063, 0.39, 0.739, 0.144, 1.0, 0.433)
# Arms accelerate gradually, pickers change their speed at once.
ARM_SWING = Swing(0.294, 0.01, 0.162, 0.603, 0.265, 0.833, 0.168)
WAITING = 3  # Env steps for the cloth to come to rest.
APPROACH = 0.5  # Fraction of full speed at which the start is approached.
RISE, RISEN = 0.3, 1.0  # Fraction of full speed and height [m] of grippers out of the way.


class DropCloth(PickerExpert):
    """Swings the cloth once."""

    def _episode(self) -> Iterator[np.ndarray]:
        swing = PICKER_SWING if isinstance(self._actor, Picker) else ARM_SWING
        goals = self._actor.positions()
        goals[:, 0] = swing.start
        goals[:, 2] = self._env.task.cloth.size[0] + swing.clearance
        yield from self._move(goals, CLOSED, APPROACH)
        for _ in range(WAITING):
            yield self._rest(CLOSED)
        yield from self._go(swing.forward, swing.forward_speed, 0.0)
        yield from self._go(-swing.back, swing.back_speed, -swing.sinking)
        yield from self._move(self._raised(RISEN), OPEN, RISE)

    def _go(self, way: float, speed: float, climb: float) -> Iterator[np.ndarray]:
        """Yields actions for a way along X [m] at a fraction of full speed, rising by another."""
        steps = abs(way) / (speed * self._stride)
        while steps > 0.0:
            part = min(steps, 1.0)
            motion = part * np.array([np.sign(way) * speed, 0.0, climb])
            yield np.column_stack([np.tile(motion, (2, 1)), np.ones(2)]).ravel()
            steps -= part
