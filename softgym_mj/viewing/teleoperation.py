"""Teleoperation: targets that a person moves, and actions that bring grippers or a cup there."""

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

GRIPPER_SPEED = 0.5  # [m/s] Half of what they can do: cloth and the eye still follow.
# Of a cup along X, along Z [m/s] and about Y [rad/s], and how fast these change [m/s^2, rad/s^2]:
# as in the way of transport_water's expert, which does not spill.
CUP_SPEED = np.array([0.6, 0.6, 1.0])
CUP_ACCELERATION = np.array([0.75, 0.75, 3.0])
# What of its way a cup goes after a rejected move: all of it, else one coordinate.
_TRIES = np.array([[1, 1, 1], [0, 1, 0], [0, 0, 1], [1, 0, 0]])
_NEAR = 1e-6  # [m, rad] What is left of a way that has been gone.
_BODY = re.compile(r"^[^/]+/\w+_(\d+)(/|$)")  # Such as picker/picker_1 or arms/franka_0/link3.


class Teleoperation(abc.ABC):
    """Targets of the parts of an actor that can be driven: its grippers, or its cup.

    Attributes:
        names: of the parts (n,).
        turns: whether the parts turn.
        grips: whether each part closes (n,); of no effect where `can_grip` is False.
        can_grip: whether the parts grip.
        axes: whether the parts move along x, y and z.
    """

    names: tuple[str, ...]
    turns: bool
    can_grip: bool
    axes: tuple[bool, bool, bool]

    def __init__(self, env: Environment):
        """Binds it to an environment; `start` has to be called after each of its resets."""
        self._env, self._actor = env, env.task.actor
        self.grips: list[bool] = []
        self._targets = np.zeros((0, 4))

    @property
    def targets(self) -> np.ndarray:
        """Where the parts are to go (n, 4), a fresh array: x, y, z [m], turn about +Y [rad]."""
        return self._targets.copy()

    def start(self) -> None:
        """Sets the targets to where the parts are told to be."""
        self._targets = self.commanded()
        self.grips = [False] * len(self._targets)

    def aim(self, part: int, target: Sequence[float] | np.ndarray) -> None:
        """Sets a target (4,) [m, m, m, rad]; it is kept within what the part may reach."""
        self._targets[part] = self._allowed(part, np.asarray(target, float))

    def shift(self, part: int, change: Sequence[float] | np.ndarray) -> None:
        """Moves a target by `change` (4,) [m, m, m, rad]."""
        self.aim(part, self._targets[part] + change)

    def part_of(self, body: str) -> int | None:
        """Which part a body of the model belongs to; None if it is none of them."""
        if body.split("/", maxsplit=1)[0] not in self._actor.model_names:
            return None
        match = _BODY.match(body)
        return int(match[1]) if match and int(match[1]) < len(self.names) else None

    @abc.abstractmethod
    def commanded(self) -> np.ndarray:
        """Where the parts are told to be (n, 4), as `targets`."""

    @abc.abstractmethod
    def action(self) -> np.ndarray:
        """The action (n,) of the next env step, in [-1, 1], on the way to the targets."""

    @abc.abstractmethod
    def _allowed(self, part: int, target: np.ndarray) -> np.ndarray:
        """A target (4,), moved to where the part may go."""


class GripperTeleoperation(Teleoperation):
    """Drives pickers or arms, straight to their targets at `GRIPPER_SPEED`."""

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
        self.grips = (self._actor.held >= 0).tolist()  # They start with a cloth that hangs.

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
    """Drives a cup to its target, speeding up and slowing down so gently that little is spilled.

    The task rejects moves into the ground or another cup. The rest of the way is then gone along
    one coordinate after the other, so that the cup slides along what stops it.
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
        # The cup in an arm's hand is a model within the arm's.
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
        # The speed from which it can come to rest at the target, as it changes once in a step.
        unit = CUP_ACCELERATION * step**2
        braking = (np.sqrt(1.0 + 8.0 * np.abs(way) / unit) - 1.0) / 2.0 * unit
        wanted = np.sign(way) * np.minimum(np.minimum(braking, np.abs(way)) / step, CUP_SPEED)
        change = CUP_ACCELERATION * step
        self._velocity += np.clip(wanted - self._velocity, -change, change)
        largest = self._actor.max_step * self._env.task.action_repeat
        return (self._velocity * step)[self._moving] / largest[self._moving]


def teleoperate(env: Environment) -> Teleoperation:
    """What drives the actor of an environment.

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
