"""`Holding`: vertices that grippers hold; `Attachment`: holds of pickers and of arms."""

import math

import numpy as np

from softgym_mj.entities.flex import Flex
from softgym_mj.entities.flex_group import FlexGroup
from softgym_mj.robots.grip import (
    NONE,
    SLIPPED,
    GripCommand,
    GripLimits,
    GripState,
    kept_in_order,
    step_grips,
)


class Holding:
    """Vertices that grippers hold, and counts of ended holds in this episode.

    Attributes:
        grips: state of the grips.
        yielded: number of holds that were released under load.
    """

    def __init__(self, num_grippers: int):
        """Starts with `num_grippers` grippers that hold nothing."""
        self._start = GripState(
            center=np.zeros((num_grippers, 3)),
            held=np.full(num_grippers, NONE),
            offset=np.zeros((num_grippers, 3)),
            dropped=np.array(0),
        )
        self.grips, self.yielded = _copied(self._start), 0

    @property
    def vertices(self) -> list[int]:
        """Vertex index that each gripper holds; negative for none."""
        return self.grips.held.tolist()

    def manipulate(self, target: Flex | FlexGroup) -> None:
        """Chooses the object whose vertices are held."""
        self._target = target

    def reset(self) -> None:
        """Starts an episode: nothing is held."""
        self.grips, self.yielded = _copied(self._start), 0

    def _drop(self, i: int, held: int = NONE) -> None:
        """Ends the hold of gripper `i`, whose state becomes `held`."""
        self.grips.held[i] = held
        self.grips = self.grips._replace(dropped=self.grips.dropped + 1)

    def get_state(self) -> dict[str, np.ndarray]:
        """Returns the state of the holds, for snapshots."""
        return {**_copied(self.grips)._asdict(), "yielded": np.array(self.yielded)}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Restores the state that `get_state` returned."""
        self.grips = _copied(GripState(*(state[name] for name in GripState._fields)))
        self.yielded = int(state["yielded"])


def _copied(grips: GripState) -> GripState:
    return GripState(*(np.array(array) for array in grips))


class Attachment(Holding):
    """Vertices attached to grippers at fixed offsets from the grippers' centers.

    A held vertex keeps its offset, but is never pushed below its resting height on the floor, and
    yields to layers that it is pressed on. A hold is released under load in three cases: before two
    held vertices are further apart than `Flex.largest_gap`, the one that was taken later; if a
    vertex pulls with more than `Flex.hold_force`; if its tracking error exceeds
    `Flex.max_tracking_error`, as it is caught. The gripper then takes nothing until it has opened.
    """

    def __init__(self, num_grippers: int):
        """Starts with `num_grippers` grippers that hold nothing."""
        super().__init__(num_grippers)
        self._order = np.zeros(num_grippers, int)  # Later holds have higher numbers.

    def reset(self) -> None:
        self._target.release_all()
        super().reset()
        self._order[:] = 0

    def take(self, i: int, vertex: int, offset: np.ndarray) -> None:
        """Attaches a vertex to gripper `i` at `offset` (3,) [m] from its center."""
        self.grips.held[i], self.grips.offset[i] = vertex, offset
        self._hold(i, vertex)

    def _hold(self, i: int, vertex: int) -> None:
        self._order[i] = self._order.max() + 1
        self._target.hold(vertex)

    def step(self, command: GripCommand, limits: GripLimits) -> None:
        """Runs a sim step of `step_grips`."""
        before = self.vertices
        self.grips = step_grips(self.grips, command, self._target.displacements_from, None, limits)
        after = self.vertices
        if after == before:
            return
        for old, new in zip(before, after, strict=True):
            if old >= 0 > new:
                self._target.release(old)
        for i, (old, new) in enumerate(zip(before, after, strict=True)):
            if old < 0 <= new:
                self._hold(i, new)

    def drive(self, centers: np.ndarray, timestep: float) -> None:
        """Moves held vertices so that they fit `centers` (n, 3) [m] after `timestep` [s]."""
        if max(self.vertices) < 0:
            return
        goals = self.places(centers)
        self._release_overloaded(goals)
        for goal, vertex in zip(goals, self.vertices, strict=True):
            if vertex >= 0:
                self._target.drive(vertex, goal, timestep)

    def _release_overloaded(self, goals: np.ndarray) -> None:
        """Releases holds under load or too far behind `goals` (n, 3) [m].

        Later holds that these pull too far from earlier ones are released, too.
        """
        for i, vertex in enumerate(self.vertices):
            if vertex >= 0 and self._target.is_overloaded(vertex, goals[i]):
                self.release_overloaded(i)
        vertices = self.vertices
        holders = [i for i, vertex in enumerate(vertices) if vertex >= 0]
        if len(holders) < 2:
            return
        holders.sort(key=self._order.__getitem__)

        def distance(i: int, j: int) -> float:
            return math.dist(goals[holders[i]], goals[holders[j]])

        def gap(i: int, j: int) -> float:
            return self._target.largest_gap(vertices[holders[i]], vertices[holders[j]])

        kept = kept_in_order([True] * len(holders), distance, gap)
        for i, stays in zip(holders, kept, strict=True):
            if not stays:
                self.release_overloaded(i)

    def release_overloaded(self, i: int) -> None:
        """Releases the vertex of gripper `i` under load."""
        self._target.release(self.vertices[i])
        self._drop(i, SLIPPED)
        self.yielded += 1

    def places(self, centers: np.ndarray) -> np.ndarray:
        """Returns targets of held vertices (n, 3) [m] for grippers at `centers`; NaN for none."""
        goals = centers + self.grips.offset
        for goal, vertex in zip(goals, self.vertices, strict=True):
            if vertex >= 0:
                goal[2] = max(goal[2], self._target.resting_height(vertex))
            else:
                goal[:] = np.nan
        return goals

    def get_state(self) -> dict[str, np.ndarray]:
        return {**super().get_state(), "order": self._order.copy()}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        self._target.release_all()
        super().set_state(state)
        self._order[:] = state["order"]
        for vertex in self.vertices:
            if vertex >= 0:
                self._target.hold(vertex)
