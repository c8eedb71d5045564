"""`Pickers`: what `Picker` and `Attachment` do, for many worlds at once."""

from collections.abc import Callable, Mapping

import numpy as np

from softgym_mj.robots.grip import NONE, SLIPPED, GripCommand, GripLimits, GripState, step_grips
from softgym_mj.robots.gripper import MAX_DISPLACEMENT

# The largest distance [m] to which pairs of vertices (k,), (k,) of worlds (k,) may be drawn.
Gap = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


class Pickers:
    """Pickers of worlds, a row for each.

    Attributes:
        grips: what they hold; `dropped` counts the holds that have ended.
        order: (num_worlds, pickers) later holds have higher numbers.
        yielded: (num_worlds,) how many holds have ended because they pulled too hard.
    """

    def __init__(self, num_worlds: int, num_pickers: int, radius: float, reach: float):
        """Pickers that hold nothing.

        Args:
            num_worlds: how many rows.
            num_pickers: in each world.
            radius: of the spheres [m].
            reach: largest distance of a vertex that they take [m].
        """
        shape = (num_worlds, num_pickers)
        self.grips = GripState(
            centre=np.zeros((*shape, 3)),
            held=np.full(shape, NONE),
            offset=np.zeros((*shape, 3)),
            dropped=np.zeros(num_worlds, int),
        )
        self.order, self.yielded = np.zeros(shape, int), np.zeros(num_worlds, int)
        self._radius, self._workspace = radius, np.zeros((num_worlds, 2, 3))
        self._limits = GripLimits(np.zeros((*shape, 3)), np.zeros((*shape, 3)), reach)
        self._command = GripCommand(np.zeros((*shape, 3)), np.zeros(shape, bool))

    def get_state(self, i: int) -> dict[str, np.ndarray]:
        """What those of a world hold, as `Picker.get_state` has it."""
        grips = {name: np.array(array[i]) for name, array in self.grips._asdict().items()}
        return {
            **grips,
            "yielded": np.array(self.yielded[i]),
            "order": self.order[i].copy(),
            "workspace": self._workspace[i].copy(),
        }

    def set_state(self, i: int, state: Mapping[str, np.ndarray]) -> None:
        """Has those of a world hold what `Picker.get_state` returned."""
        for name, array in self.grips._asdict().items():
            array[i] = state[name]
        self.yielded[i], self.order[i] = state["yielded"], state["order"]
        self._workspace[i] = state["workspace"]
        low, high = self._workspace[i]
        self._limits.low[i], self._limits.high[i] = low + self._radius, high - self._radius

    def command(self, actions: np.ndarray) -> None:
        """Starts an env step with actions (num_worlds, 4 * pickers)."""
        each = actions.reshape((*self.order.shape, 4))
        self._command = GripCommand(MAX_DISPLACEMENT * each[..., :3], each[..., 3] > 0.0)

    def plan(self, offsets: Callable[[np.ndarray], np.ndarray], present: np.ndarray) -> None:
        """Starts a sim step; arguments as of `step_grips`."""
        before = self.grips.held
        self.grips = step_grips(self.grips, self._command, offsets, present, self._limits)
        for i in range(self.order.shape[1]):
            takes = (before[:, i] < 0) & (self.grips.held[:, i] >= 0)
            self.order[:, i] = np.where(takes, self.order.max(1) + 1, self.order[:, i])

    def goals(self, resting_height: np.ndarray) -> np.ndarray:
        """Where held vertices belong (num_worlds, pickers, 3) [m]; anything if none is held.

        Args:
            resting_height: of vertices, on the floor (num_worlds,) [m].
        """
        goals = self.grips.centre + self.grips.offset
        goals[..., 2] = np.maximum(goals[..., 2], resting_height[:, None])
        return goals

    def give_way(self, goals: np.ndarray, overpowered: np.ndarray, gap: Gap) -> None:
        """Ends holds that pull too hard, and later ones that pull too far from earlier ones.

        Args:
            goals: from `goals`.
            overpowered: whether a vertex pulls with more than a grip can take (num_worlds,
                pickers) bool.
            gap: how far pairs of vertices may be apart.
        """
        self._slip(overpowered & (self.grips.held >= 0))
        held = self.grips.held
        ranks = np.argsort(np.where(held >= 0, self.order, self.order.max() + 1), 1, kind="stable")
        rows, kept = np.arange(len(held)), held >= 0
        for second in range(held.shape[1]):
            j = ranks[:, second]
            for first in range(second):
                i = ranks[:, first]
                both = kept[rows, i] & kept[rows, j]
                (of,) = np.nonzero(both)
                if not len(of):
                    continue
                away = np.linalg.norm(goals[of, i[of]] - goals[of, j[of]], axis=-1)
                kept[of, j[of]] &= away <= gap(of, held[of, i[of]], held[of, j[of]])
        self._slip(~kept & (held >= 0))

    def _slip(self, which: np.ndarray) -> None:
        """What some (num_worlds, pickers) bool hold is pulled out of them."""
        number = which.sum(1)
        self.yielded = self.yielded + number
        self.grips = self.grips._replace(
            held=np.where(which, SLIPPED, self.grips.held), dropped=self.grips.dropped + number
        )
