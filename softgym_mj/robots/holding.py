"""`Holding`: the vertices of a flex that grippers hold, shared by pickers and arms."""

import math
from collections.abc import Sequence
from typing import Generic, TypeVar

import numpy as np
from dm_control import composer, mjcf

from softgym_mj.entities.flex import Flex
from softgym_mj.entities.flex_group import FlexGroup
from softgym_mj.native.arithmetic import squares
from softgym_mj.robots.gripper import Gripper

MAX_DISPLACEMENT = 0.01  # [m] per axis and sim step: 1 m/s per axis (facts 2.1).


class Held:
    """Which vertex each gripper holds, and what became of holds in this episode.

    Attributes:
        vertices: that each gripper holds, -1 for none.
        dropped: how often one was let go.
        yielded: how often that was because grippers pulled too hard.
    """

    def __init__(self, num_grippers: int):
        """All of `num_grippers` grippers hold nothing."""
        self.vertices = [-1] * num_grippers  # A list: it is read several times in every sim step.
        self.dropped = self.yielded = 0

    def manipulate(self, target: Flex | FlexGroup) -> None:
        """Chooses the object whose vertices are held."""
        self._target = target

    def reset(self) -> None:
        """Starts an episode: nothing is held."""
        self.vertices[:] = [-1] * len(self.vertices)
        self.dropped = self.yielded = 0

    def get_state(self) -> dict[str, np.ndarray]:
        """What is held, for snapshots."""
        return {
            "held": np.array(self.vertices),
            "dropped": np.array(self.dropped),
            "yielded": np.array(self.yielded),
        }

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Restores what `get_state` returned."""
        self.vertices[:] = [int(vertex) for vertex in state["held"]]
        self.dropped, self.yielded = int(state["dropped"]), int(state["yielded"])


class Holding(Held):
    """Vertices attached to grippers, each where it is relative to the gripper's centre.

    A held vertex keeps its offset to the centre, except that it is never pushed below its resting
    height on the floor, and gives way to layers that it is pressed on. No force in the object can
    stop two that are pulled apart: before they get further from each other than
    `Flex.largest_gap`, the one that was taken later slips away. So does one that friction or weight
    pulls at with more than `Flex.hold_force`. The gripper takes nothing more until it has been
    open.
    """

    def __init__(self, num_grippers: int):
        """All of `num_grippers` grippers hold nothing."""
        super().__init__(num_grippers)
        self.offsets = np.zeros((num_grippers, 3))
        self._order = np.zeros(num_grippers, int)  # Later holds have higher numbers.
        self._slipped = np.zeros(num_grippers, bool)  # And have not been open since.

    def reset(self) -> None:
        self._target.release_all()
        super().reset()
        self._order[:] = 0
        self._slipped[:] = False

    def release(self, i: int) -> None:
        """Lets go of what gripper `i` holds."""
        self._target.release(self.vertices[i])
        self.vertices[i] = -1
        self.dropped += 1

    def take(self, i: int, vertex: int, offset: np.ndarray) -> None:
        """Gripper `i` holds a vertex at `offset` (3,) [m] from its centre."""
        self.vertices[i] = vertex
        self.offsets[i] = offset
        self._order[i] = self._order.max() + 1
        self._target.hold(vertex)

    def open(self, grips: Sequence[bool]) -> None:
        """Lets go of what grippers hold whose grip is off; they can take something again."""
        for i, grip in enumerate(grips):
            if not grip:
                self._slipped[i] = False
                if self.vertices[i] >= 0:
                    self.release(i)

    def can_take(self, i: int) -> bool:
        """Whether gripper `i` takes something if it grips."""
        return self.vertices[i] < 0 and not self._slipped[i]

    def pick(self, i: int, centre: np.ndarray, reach: float) -> None:
        """Gripper `i` takes the nearest free vertex within `reach` [m] of `centre`, if any.

        The first index wins a tie.
        """
        offsets = self._target.offsets(centre)
        distances = squares(offsets)
        for vertex in self.vertices:
            if vertex >= 0:
                distances[vertex] = np.inf
        nearest = int(distances.argmin())
        if distances[nearest] <= reach**2:
            self.take(i, nearest, offsets[nearest])

    def drive(self, centres: np.ndarray, timestep: float) -> None:
        """Moves what is held so that it belongs to `centres` (n, 3) [m] after `timestep` [s]."""
        goals = self.places(centres)
        self._give_way(goals)
        for goal, vertex in zip(goals, self.vertices, strict=True):
            if vertex >= 0:
                self._target.drive(vertex, goal, timestep)

    def _give_way(self, goals: np.ndarray) -> None:
        """Ends holds that pull too hard.

        And later ones that `goals` (n, 3) [m] would pull too far from earlier ones.
        """
        for i, vertex in enumerate(self.vertices):
            if vertex >= 0 and self._target.is_overpowered(vertex):
                self.slip(i)
        kept: list[int] = []
        holders = [i for i, vertex in enumerate(self.vertices) if vertex >= 0]
        for i in sorted(holders, key=self._order.__getitem__):
            vertex = self.vertices[i]
            if all(
                math.dist(goals[i], goals[j]) <= self._target.largest_gap(vertex, self.vertices[j])
                for j in kept
            ):
                kept.append(i)
            else:
                self.slip(i)

    def slip(self, i: int) -> None:
        """What gripper `i` holds is pulled out of it."""
        self.release(i)
        self.yielded += 1
        self._slipped[i] = True

    def places(self, centres: np.ndarray) -> np.ndarray:
        """Where held vertices belong (n, 3) [m] with grippers at `centres`; NaN if none is held."""
        goals = centres + self.offsets
        for goal, vertex in zip(goals, self.vertices, strict=True):
            if vertex >= 0:
                goal[2] = max(goal[2], self._target.resting_height(vertex))
            else:
                goal[:] = np.nan
        return goals

    def get_state(self) -> dict[str, np.ndarray]:
        return {
            **super().get_state(),
            "offset": self.offsets.copy(),
            "order": self._order.copy(),
            "slipped": self._slipped.copy(),
        }

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        self._target.release_all()
        super().set_state(state)
        self.offsets[:] = state["offset"]
        self._order[:] = state["order"]
        self._slipped[:] = state["slipped"]
        for vertex in self.vertices:
            if vertex >= 0:
                self._target.hold(vertex)


H = TypeVar("H", bound=Held)


class HoldingGripper(composer.Entity, Gripper, Generic[H]):
    """Grippers in a model of their own that move by displacement within `limits` and hold vertices.

    A subclass's `_build` sets `_mjcf_root` and `_holding`; its `place` sets `_low` and `_high`.
    """

    _mjcf_root: mjcf.RootElement
    _holding: H
    _low: np.ndarray
    _high: np.ndarray

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """Its MJCF."""
        return self._mjcf_root

    @property
    def model_names(self) -> tuple[str, ...]:
        return (self._mjcf_root.model,)

    @property
    def num_grippers(self) -> int:
        return len(self._holding.vertices)

    @property
    def action_size(self) -> int:
        return 4 * self.num_grippers

    @property
    def held(self) -> np.ndarray:
        return np.array(self._holding.vertices)

    @property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest gripper centre (3,) [m] of the workspace; arms may not reach as far.

        How far they do: `within_reach`.
        """
        return self._low, self._high

    def join(self, arena: composer.Arena) -> None:
        arena.attach(self)

    def manipulate(self, target: Flex | FlexGroup) -> None:
        self._target = target
        self._holding.manipulate(target)

    def command(self, action: np.ndarray) -> None:
        action = action.reshape(-1, 4)
        self._displacement = MAX_DISPLACEMENT * action[:, :3]
        self._grips = (action[:, 3] > 0.0).tolist()

    def diagnostics(self) -> dict[str, float | int]:
        holding = self._holding
        return {
            **super().diagnostics(),
            "dropped": holding.dropped,
            "yielded": holding.yielded,
        }
