"""The expert of DropCloth: swings the cloth to and fro and lets go when it is stretched out.

The cloth trails behind while the pickers move towards +X; it swings forward when they turn back,
and is let go when its lower edge flies towards +X and the held one towards -X. The numbers were
found by random search on training variations, with the coarse cloth.
"""

from collections.abc import Iterator

import numpy as np

from softgym_mj.baselines.scripted.picker_expert import CLOSED, OPEN, PickerExpert

START = -0.12  # [m] X of the pickers before the swing.
CLEARANCE = 0.05  # [m] Of the lower edge above the floor there, if the workspace allows.
WAITING = 3  # Env steps for the cloth to come to rest.
APPROACH = 0.5  # Fraction of full speed at which the start is approached.
FORWARD, FORWARD_SPEED = 0.46, 0.743  # Way [m] and fraction of full speed towards +X,
BACK, BACK_SPEED = 0.117, 0.973  # and back.
SINKING = 0.2  # Fraction of full speed downwards on the way back.
RISE = 0.3  # Fraction of full speed at which the pickers then get out of the way.


class DropCloth(PickerExpert):
    """Swings the cloth once."""

    def _episode(self) -> Iterator[np.ndarray]:
        goals = self._actor.positions()
        goals[:, 0] = START
        goals[:, 2] = self._env.task.cloth.size[0] + CLEARANCE
        yield from self._move(goals, CLOSED, APPROACH)
        for _ in range(WAITING):
            yield self._rest(CLOSED)
        yield from self._go(FORWARD, FORWARD_SPEED, 0.0)
        yield from self._go(-BACK, BACK_SPEED, -SINKING)
        while True:
            yield self._step(self._raised(1.0), OPEN, RISE)

    def _go(self, way: float, speed: float, climb: float) -> Iterator[np.ndarray]:
        """Actions for a way along X [m] at a fraction of full speed, rising by another."""
        steps = abs(way) / (speed * self._stride)
        while steps > 0.0:
            part = min(steps, 1.0)
            motion = part * np.array([np.sign(way) * speed, 0.0, climb])
            yield np.column_stack([np.tile(motion, (2, 1)), np.ones(2)]).ravel()
            steps -= part
