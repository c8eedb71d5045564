"""`CupMover`: moves a cup by its pose, as SoftGym does (docs/softgym.md 3.1 and 3.2)."""

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from dm_control import composer

from softgym_mj.entities.cup import Cup
from softgym_mj.entities.cup_poses import corners, is_clear, outline, overlap
from softgym_mj.entities.flex_group import FlexGroup
from softgym_mj.metrics import Array, columns, namespace
from softgym_mj.robots.base import SIM_STEP, ActionSpace, Actor
from softgym_mj.robots.workspace import ToolStart

# [m] Tolerance of the ground test: the bottom of an upright cup is exactly at its limit.
GROUND_TOLERANCE = 1e-6

NAMES, UNITS = ("dx", "dz", "dtheta"), ("m", "m", "rad")

# Cups for a rule, by name: sizes (..., 4) as in `Cup.arrays`, poses (..., 3).
Cups = Mapping[str, tuple[Array, Array]]
# Maps desired poses (..., 3) to allowed poses, and returns which moves (...) are accepted.
Rule = Callable[[Array, Cups], tuple[Array, Array]]


@dataclasses.dataclass(frozen=True)
class Track:
    """Rule that clips x [m] to [low, high]."""

    low: float
    high: float

    def __call__(self, pose: Array, cups: Cups) -> tuple[Array, Array]:
        xp = namespace(pose)
        x = xp.clip(pose[..., :1], self.low, self.high)
        return xp.concat([x, pose[..., 1:]], axis=-1), pose[..., 0] == pose[..., 0]


@dataclasses.dataclass(frozen=True)
class KeepClear:
    """Rule that rejects moves of a cup into the ground or into another cup.

    Attributes:
        cup, other: names of the two.
    """

    cup: str
    other: str

    def __call__(self, pose: Array, cups: Cups) -> tuple[Array, Array]:
        xp, size = namespace(pose), cups[self.cup][0]
        # A cup rests half a wall deep in the ground.
        lowest = -size[..., 3] / 2 - GROUND_TOLERANCE
        if isinstance(pose, np.ndarray) and pose.ndim == 1:
            other = [array.tolist() for array in cups[self.other]]
            return pose, np.array(is_clear(lowest, (size.tolist(), pose.tolist()), other))
        above = xp.min(corners(size, pose)[..., 1], axis=-1) >= lowest
        return pose, above & ~overlap(outline(size, pose), outline(*cups[self.other]))


@dataclasses.dataclass(frozen=True)
class CupTool:
    """Cup that an actor moves, and limits of its motion.

    Attributes:
        cup: the cup, not yet attached.
        max_step: largest change of x [m], z [m] and theta [rad] in a sim step; 0 where fixed.
        rule: maps desired to allowed poses.
        others: further cups for the rule.
        base_x: X [m] of the base of an arm that holds the cup.
    """

    cup: Cup
    max_step: Sequence[float]
    rule: Rule
    base_x: float = 0.0
    others: Sequence[Cup] = ()


def cup_step(max_step: np.ndarray, actions: Array) -> Array:
    """Returns desired changes of pose (..., 3) in a sim step: x [m], z [m], theta [rad].

    Args:
        max_step: largest changes (3,); 0 where the cup is fixed.
        actions: fractions of these (..., n), of the coordinates that move.
    """
    parts = [0.0 * actions[..., 0]] * 3
    for k, i in enumerate(np.flatnonzero(max_step).tolist()):
        parts[i] = float(max_step[i]) * actions[..., k]
    return columns(*parts)


def moved(rule: Rule, pose: Array, step: Array, cups: Cups) -> tuple[Array, Array]:
    """Returns poses (..., 3) after a sim step, and whether (...) moves were accepted.

    Args:
        rule: maps desired to allowed poses.
        pose: previous pose (..., 3).
        step: desired changes (..., 3).
        cups: cups for the rule.
    """
    wanted, allowed = rule(pose + step, cups)
    return namespace(pose).where(allowed[..., None], wanted, pose), allowed


class CupMover(Actor):
    """Moves a cup by up to `max_step` in every sim step, subject to a rule.

    The action has one entry for each coordinate of the pose that moves, a fraction of its largest
    step. The cup follows exactly: water cannot push it.

    Attributes:
        cup: the cup.
        max_step: largest change (3,) of x [m], z [m] and theta [rad] in a sim step.
    """

    name = "cup"
    ends_states = False

    def __init__(self, tool: CupTool):
        """Binds the mover to its cup."""
        self.cup, self.rule, self._others = tool.cup, tool.rule, tool.others
        self.max_step = np.array(tool.max_step, float)
        self._moving = np.flatnonzero(self.max_step)
        self._start = self._goal = self._step = np.zeros(3)
        self._rejected = 0

    @property
    def commanded_pose(self) -> np.ndarray:
        """Commanded pose (3,), a fresh array; equal to the pose of the cup."""
        return self.cup.pose

    @property
    def model_names(self) -> tuple[str, ...]:
        """Model names labeled as the actor in segmentation images: none, a cup is a container."""
        return ()

    @functools.cached_property
    def actions(self) -> ActionSpace:
        entries = tuple(
            (NAMES[i], UNITS[i], f"-{self.max_step[i]:g} to {self.max_step[i]:g} per sim step")
            for i in self._moving
        )
        return ActionSpace(entries, ", ".join(name for name, _, _ in entries))

    def join(self, arena: composer.Arena) -> None:
        self.cup.join(arena)

    def manipulate(self, target: FlexGroup) -> None:
        """Does nothing: the mover holds its cup only."""

    def begin(self, start: ToolStart, vertices: np.ndarray) -> None:
        x, _, z = start.point
        self.place(np.array([x, z, 0.0]))

    def place(self, pose: np.ndarray) -> None:
        """Starts an episode with the cup at a pose (x, z, theta)."""
        self.cup.pose = self._start = self._goal = pose
        self._rejected = 0

    def command(self, action: np.ndarray) -> None:
        self._step = cup_step(self.max_step, action)
        self._rejected = 0

    def _wanted(self) -> np.ndarray:
        """Returns the pose (3,) for the next sim step."""
        pose = self.commanded_pose
        cups = {cup.mjcf_model.model: (cup.arrays["size"], cup.pose) for cup in self._others}
        cups[self.cup.mjcf_model.model] = self.cup.arrays["size"], pose
        goal, allowed = moved(self.rule, pose, self._step, cups)
        self._rejected += not allowed
        return goal

    def plan(self) -> None:
        self._start, self._goal = self.cup.pose, self._wanted()

    def move(self, fraction: float, timestep: float) -> None:
        self.cup.pose = self._goal - (1.0 - fraction) * (self._goal - self._start)

    def proprioception(self) -> np.ndarray:
        """Returns the pose of the cup (3,): x [m], z [m], theta [rad]."""
        return self.cup.pose

    @property
    def senses(self) -> dict[str, int]:
        return {"cup x, z [m]": 2, "cup theta [rad]": 1}

    def remembered(self) -> np.ndarray:
        """Returns the velocity of the cup (3,) in the last sim step, on which the water depends."""
        return (self._goal - self._start) / SIM_STEP

    @property
    def remembers(self) -> dict[str, int]:
        return {"cup velocity along x, z [m/s]": 2, "cup velocity of theta [rad/s]": 1}

    def diagnostics(self) -> dict[str, float | int]:
        return {"rejected_moves": self._rejected}

    def get_state(self) -> dict[str, np.ndarray]:
        way = np.array([self._start, self._goal])
        return {"rejected": np.array(self._rejected), "way": way}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        self._rejected = int(state["rejected"])
        self._start, self._goal = state["way"].copy()
