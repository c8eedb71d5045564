"""Teleoperation: targets set by a user, and actions that move grippers or a cup to them."""

import abc
import re
from collections.abc import Sequence

import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.cup_mover import CupMover
from softgym_mj.robots.factory import CUP_ACTORS, GRIPPERS, PICKERS
from softgym_mj.robots.gripper import MAX_DISPLACEMENT, Gripper
from softgym_mj.robots.pick_and_place import RoutePicker

GRIPPER_SPEED = 0.5  # [m/s] Half of the largest speed: cloth and eyes can follow.
# Speeds of a cup along X, Z [m/s] and about Y [rad/s], and accelerations [m/s^2, rad/s^2]: as in
# transport_water's expert, which does not spill.
CUP_SPEED = np.array([0.6, 0.6, 1.0])
CUP_ACCELERATION = np.array([0.75, 0.75, 3.0])
# Coordinates along which a cup moves after a rejected move: all, else one.
_TRIES = np.array([[1, 1, 1], [0, 1, 0], [0, 0, 1], [1, 0, 0]])
_NEAR = 1e-6  # [m, rad] Distance below which a target is reached.
_BODY = re.compile(r"^[^/]+/\w+_(\d+)(/|$)")  # Such as picker/picker_1 or arms/franka_0/link3.


class Teleoperation(abc.ABC):
    """Targets of the controllable parts of an actor: its grippers, or its cup.

    Attributes:
        names: names of the parts (n,).
        turns: whether the parts rotate.
        grips: whether each part closes (n,); no effect if `can_grip` is False.
        can_grip: whether the parts grip.
        axes: whether the parts move along x, y and z.
    """

    names: tuple[str, ...]
    turns: bool
    can_grip: bool
    axes: tuple[bool, bool, bool]

    def __init__(self, env: Environment):
        """Binds it to an environment; call `start` after each of its resets."""
        self._env, self._actor = env, env.task.actor
        self.grips: list[bool] = []
        self._targets = np.zeros((0, 4))

    @property
    def targets(self) -> np.ndarray:
        """Targets of the parts (n, 4), a fresh array: x, y, z [m], rotation about +Y [rad]."""
        return self._targets.copy()

    def start(self) -> None:
        """Sets the targets to the commanded positions of the parts."""
        self._targets = self.commanded()
        self.grips = [False] * len(self._targets)

    def aim(self, part: int, target: Sequence[float] | np.ndarray) -> None:
        """Sets a target (4,) [m, m, m, rad], clipped to the part's range."""
        self._targets[part] = self._allowed(part, np.asarray(target, float))

    def shift(self, part: int, change: Sequence[float] | np.ndarray) -> None:
        """Moves a target by `change` (4,) [m, m, m, rad]."""
        self.aim(part, self._targets[part] + change)

    def part_of(self, body: str) -> int | None:
        """Returns the part to which a body of the model belongs; None if none."""
        if body.split("/", maxsplit=1)[0] not in self._actor.model_names:
            return None
        match = _BODY.match(body)
        return int(match[1]) if match and int(match[1]) < len(self.names) else None

    @abc.abstractmethod
    def commanded(self) -> np.ndarray:
        """Returns the commanded positions of the parts (n, 4), as `targets`."""

    @abc.abstractmethod
    def action(self) -> np.ndarray:
        """Returns the action (n,) of the next env step, in [-1, 1], towards the targets."""

    @abc.abstractmethod
    def _allowed(self, part: int, target: np.ndarray) -> np.ndarray:
        """Returns a target (4,), clipped to the part's range."""


class GripperTeleoperation(Teleoperation):
    """Moves pickers or arms straight to their targets at `GRIPPER_SPEED`."""

    turns = False
    can_grip = True
    axes = (True, True, True)
    _actor: Gripper

    def __init__(self, env: Environment):
        super().__init__(env)
        kind = "picker" if self._actor.model_names == ("picker",) else "arm"
        self.names = tuple(f"{kind} {i + 1}" for i in range(self._actor.num_grippers))

    def start(self) -> None:
        super().start()
        # Tasks with a hanging cloth start with closed grippers.
        self.grips = (self._actor.held >= 0).tolist()

    def commanded(self) -> np.ndarray:
        points = self._actor.commanded_positions()
        return np.column_stack([points, np.zeros(len(points))])

    def _allowed(self, part: int, target: np.ndarray) -> np.ndarray:
        point = np.clip(target[:3], *self._actor.limits)
        return np.append(self._actor.within_reach(part, point), 0.0)

    def action(self) -> np.ndarray:
        repeat = self._env.task.action_repeat
        way = (self._targets - self.commanded())[:, :3]
        distance = np.linalg.norm(way, axis=1, keepdims=True)
        largest = GRIPPER_SPEED * SIM_STEP * repeat
        way *= np.minimum(1.0, largest / np.maximum(distance, 1e-12))
        return self._actor.displacing(way / (MAX_DISPLACEMENT * repeat), self.grips)


class CupTeleoperation(Teleoperation):
    """Moves a cup to its target with limited acceleration, so that little is spilled.

    The task rejects moves into the ground or another cup. The rest of the motion then follows one
    coordinate after the other, so that the cup slides along the obstacle.
    """

    names = ("cup",)
    can_grip = False
    _actor: CupMover

    def __init__(self, env: Environment):
        super().__init__(env)
        self._moving = self._actor.max_step > 0.0
        self.turns = bool(self._moving[2])
        self.axes = bool(self._moving[0]), False, bool(self._moving[1])

    def start(self) -> None:
        super().start()
        self._velocity, self._blocked = np.zeros(3), 0

    def part_of(self, body: str) -> int | None:
        models = self._actor.cup.mjcf_model.model, *self._actor.model_names
        # The cup in an arm's hand is part of the arm's model.
        return 0 if body.split("/", maxsplit=1)[0] in models else None

    def commanded(self) -> np.ndarray:
        x, z, theta = self._actor.commanded_pose
        return np.array([[x, 0.0, z, theta]])

    def _allowed(self, part: int, target: np.ndarray) -> np.ndarray:
        x, _, z, theta = np.where(self._moving[[0, 0, 1, 2]], target, self.commanded()[0])
        return np.array([x, 0.0, max(z, 0.0), theta])

    def action(self) -> np.ndarray:
        step = self._env.control_timestep()
        if self._actor.diagnostics()["rejected_moves"]:
            self._blocked += 1
            self._velocity[:] = 0.0
        left = (self._targets - self.commanded())[0, [0, 2, 3]]
        for _ in _TRIES:
            way = left * _TRIES[self._blocked % len(_TRIES)]
            if np.abs(way).max() > _NEAR:
                break
            self._blocked += 1
        # Speed from which it can stop at the target, changing once in a step.
        unit = CUP_ACCELERATION * step**2
        braking = (np.sqrt(1.0 + 8.0 * np.abs(way) / unit) - 1.0) / 2.0 * unit
        wanted = np.sign(way) * np.minimum(np.minimum(braking, np.abs(way)) / step, CUP_SPEED)
        change = CUP_ACCELERATION * step
        self._velocity += np.clip(wanted - self._velocity, -change, change)
        largest = self._actor.max_step * self._env.task.action_repeat
        return (self._velocity * step)[self._moving] / largest[self._moving]


def teleoperate(env: Environment) -> Teleoperation:
    """Returns the teleoperation of an environment's actor.

    Raises:
        InvalidArgumentError: if the actor does not move by displacement.
    """
    actor = env.task.actor
    if isinstance(actor, CupMover):
        return CupTeleoperation(env)
    if isinstance(actor, Gripper) and actor.displaces:
        return GripperTeleoperation(env)
    displaced = [
        name
        for name in dict.fromkeys((*GRIPPERS, *CUP_ACTORS))
        if not issubclass(PICKERS.get(name, object), RoutePicker)
    ]
    raise InvalidArgumentError("actor", actor.name, displaced)
