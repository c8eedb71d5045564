"""Keys and mouse in MuJoCo's viewer: they move targets, and start and stop episodes.

The viewer reports key presses only, neither durations nor repeats, so a press moves a target by a
step. All letters, 0 to 5 and F1 to F7 are used by the viewer itself.
"""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from softgym_mj.viewing.session import TELEOPERATE, Session
from softgym_mj.viewing.teleoperation import Teleoperation

STEPS = (0.01, 0.02, 0.05, 0.1, 0.2)  # [m] Step sizes of a press.
TURN = np.deg2rad(5.0)  # [rad] Rotation of a cup by a press.


@dataclasses.dataclass(frozen=True)
class Key:
    """A key, or a group of keys: GLFW codes, label and description of its function."""

    codes: tuple[int, ...]
    label: str
    use: str


MOVE = Key((263, 262, 265, 264), "arrows", "move along the floor, as seen")
LIFT = Key((61, 45), "= -", "move up, down")
TIP = Key((56, 57), "8 9", "tip the cup")
GRIP = Key((257,), "Enter", "close or open the grip")
OTHER = Key((46,), ".", "drive the other one, or both")
STEP = Key((54, 55), "6 7", "shorter, longer steps")
PAUSE = Key((32,), "Space", "pause, go on")
RESET = Key((259,), "Backspace", "start again")
NEXT = Key((267,), "Page Down", "next variation")
EXPERT = Key((297,), "F8", "the expert plays, or you")
HELP = Key((298,), "F9", "hide these lines, or show them")
MOUSE = Key((), "mouse", "double-click it, then drag with Ctrl and the right button")


def keys_of(teleoperation: Teleoperation | None) -> list[Key]:
    """Returns the active keys while `teleoperation`, or a policy, controls the actor."""
    keys = []
    if teleoperation is not None:
        keys += [MOVE, LIFT]
        keys += [TIP] if teleoperation.turns else []
        keys += [GRIP] if teleoperation.can_grip else []
        keys += [OTHER] if len(teleoperation.names) > 1 else []
        keys += [STEP, MOUSE]
    return keys + [PAUSE, RESET, NEXT, EXPERT, HELP]


def ground_axes(right: np.ndarray) -> np.ndarray:
    """Returns the horizontal world axes (2, 3) nearest to a picture's right and away direction.

    Args:
        right: direction (3,) to the right of the picture.
    """
    axis = int(abs(right[1]) > abs(right[0]))
    to_right = np.zeros(3)
    to_right[axis] = 1.0 if right[axis] >= 0.0 else -1.0
    return np.array([to_right, [-to_right[1], to_right[0], 0.0]])


class Keyboard:
    """Converts key presses to targets and commands of a session.

    Attributes:
        step: length of a step [m].
        driven: parts that the keys control.
        helping: whether the list of keys is shown.
    """

    def __init__(self, session: Session, right: Callable[[], np.ndarray]):
        """Binds the keys to a session; `right` returns the picture's right direction (3,)."""
        self._session, self._right = session, right
        self.step, self.driven, self.helping = STEPS[2], [0], True

    def press(self, code: int) -> None:
        """Posts a key's function to the session; may be called from any thread."""
        self._session.post(lambda: self._do(code))

    def _do(self, code: int) -> None:
        session = self._session
        if code in PAUSE.codes:
            session.paused = not session.paused
        elif code in RESET.codes:
            session.play()
        elif code in NEXT.codes:
            session.play_next()
        elif code in EXPERT.codes:
            session.play(TELEOPERATE if session.teleoperation is None else "scripted")
        elif code in HELP.codes:
            self.helping = not self.helping
        elif session.teleoperation is not None:
            self._drive(code, session.teleoperation)

    def _drive(self, code: int, teleoperation: Teleoperation) -> None:
        change = np.zeros(4)
        if code in MOVE.codes:
            right, away = self.step * ground_axes(self._right())
            change[:3] = dict(zip(MOVE.codes, (-right, right, away, -away), strict=True))[code]
        elif code in LIFT.codes:
            change[2] = self.step if code == LIFT.codes[0] else -self.step
        elif code in TIP.codes:
            change[3] = -TURN if code == TIP.codes[0] else TURN
        elif code in GRIP.codes:
            closed = all(teleoperation.grips[part] for part in self.driven)
            for part in self.driven:
                teleoperation.grips[part] = not closed
        elif code in OTHER.codes:
            parts = range(len(teleoperation.names))  # Each part in turn, then all.
            choices = [*([part] for part in parts), list(parts)]
            self.driven = choices[(choices.index(self.driven) + 1) % len(choices)]
        elif code in STEP.codes:
            index = STEPS.index(self.step) + (1 if code == STEP.codes[1] else -1)
            self.step = STEPS[min(max(index, 0), len(STEPS) - 1)]
        if change.any():
            for part in self.driven:
                teleoperation.shift(part, change)


class Mouse:
    """Lets a part follow the mouse while MuJoCo's viewer drags one of its bodies."""

    def __init__(self, keyboard: Keyboard):
        """Binds the mouse: the keys control the double-clicked part, too."""
        self._keyboard = keyboard
        self._selected = 0
        self._offset: np.ndarray | None = None

    def follow(self, perturb: Any, model: Any, teleoperation: Teleoperation) -> None:
        """Reads the viewer's `mujoco.MjvPerturb`."""
        part = None
        if perturb.select > 0:
            part = teleoperation.part_of(model.body(perturb.select).name)
        if part is not None and perturb.select != self._selected:
            self._keyboard.driven = [part]
        self._selected = perturb.select
        if part is None or not perturb.active:
            self._offset = None
            return
        turn = 2.0 * np.arctan2(perturb.refquat[2], perturb.refquat[0])
        dragged = np.array([*perturb.refpos, turn])
        if self._offset is None:
            self._offset = teleoperation.targets[part] - dragged
        teleoperation.aim(part, dragged + self._offset)
