"""DropCloth and DropFoldCloth (SoftGym: ClothDrop, ClothFoldDrop): drop a hanging cloth so that it
lies flat, or folded in half, on the floor.

Goal: column i of SoftGym's particles at x = i rho, the rows centred about Y = 0; in DropFoldCloth
the second half of the columns there, and columns 0 to half on top of their mirror columns. Two
pickers that cannot get lower than 0.55 m, so that the cloth has to be swung. DropCloth: 30 env
steps of 16 sim steps (the paper's 15 of 32: `action_repeat=32`, `horizon=15`); DropFoldCloth: 100
of 8.

Reward = performance. DropCloth: -(mean distance of the particles from their places) [m].
DropFoldCloth: -(mean distance of the pairs) - 1.2 (mean distance of the second half from its place)
[m]; SoftGym takes the hanging cloth for its place, which the words of the paper contradict.
Bounds: lower = at reset, upper = 0.
Reduced state: corners p1 p2 p3 p4 (x, y, z each), picker 0, picker 1: 18 entries [m].
Start: the cloth hangs by the corners p1, p2 of column 0, which picker 0 and picker 1 hold from 5 cm
above: an action with grip <= 0 lets go. Sizes of 60..99 (DropCloth) or 60..119 particles a side.
End: horizon only.
"""

from collections.abc import Mapping, Sequence
from typing import Unpack

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.cloth import Cloth
from softgym_mj.exceptions import InvalidArgumentError, check_name
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.factory import GripperSettings, action_repeat_of, make_actor
from softgym_mj.robots.gripper import Gripper, Workspace
from softgym_mj.robots.models import ARMS
from softgym_mj.tasks.cloth_task import ClothInitializer, ClothTask
from softgym_mj.tasks.flex_task import Layout
from softgym_mj.tasks.shared.observations import DEFAULT_IMAGE_SIZE
from softgym_mj.tasks.shared.starts.flexes import SIZE_RANGE, HangingCloth
from softgym_mj.tasks.shared.state import Episode, State

ACTION_REPEAT, FOLD_ACTION_REPEAT = 16, 8  # Facts 1.2; 5, row 1.
WORKSPACE = Workspace((-0.3, -0.5, 0.5), (0.5, 0.5, 2.0))  # Facts 2.2.
# Those with a gripper for each held corner.
ACTORS = ("picker", "pick_and_place", *ARMS)
BASE_HEIGHT = 0.5  # [m] Of arms: that of the lowest pickers.
SIZES = (60, 100)  # Of DropCloth [particles], the upper end exclusive: facts 5, row 27.
SUCCESS = 0.8  # Ours: vertices of a cloth of 0.5 m are 10 cm from their places on average,
FOLD_SUCCESS = 0.85  # or folded with some wrinkles; a heap in the right place scores 0.7.


class DropTask(ClothTask):
    """What the two tasks share: the start and where the flat cloth ought to lie."""

    def __init__(
        self,
        cloth: Cloth,
        actor: Gripper,
        initializer: ClothInitializer,
        success: float,
        **settings,
    ):
        """Wires the task; `success` as in `Layout`, `settings` as in `ClothTask`."""
        if actor.num_grippers != 2:
            number = actor.num_grippers
            raise InvalidArgumentError("number of grippers", number, "2, for the two corners held")
        layout = Layout("cloth_drop", WORKSPACE, actor.hold_height, success)
        super().__init__(layout, cloth, actor, initializer, **settings)

    def place(self) -> np.ndarray:
        """Where the vertices (n, 3) [m] of the flat cloth ought to lie."""
        return self.cloth.flat(centre=(self.cloth.size[0] / 2, 0.0))

    def start(self, state: np.ndarray) -> None:
        self.cloth.set_vertices(state)
        corners = self.cloth.corners[:2]
        held = corners[self.actor.order(self.cloth.vertices()[corners])]
        above = np.array([0.0, 0.0, self.actor.hold_height])
        self.actor.place(self.cloth.vertices()[held] + above, WORKSPACE)
        self.actor.take(held.tolist())

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """SoftGym's particles (dimy, dimx, 3) [m] of the flat cloth in its place."""
        return {"particles": self.cloth.particles(self.place())}

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return episode.initial_performance, 0.0


class DropCloth(DropTask):
    """See the module docstring."""

    def measure(self, state: State, episode: Episode) -> Measures:
        shape, goal = episode.shapes["cloth"], episode.goal["particles"]
        performance = -metrics.offsets(shape, state.points["cloth"], goal)
        return Measures(performance, rewards={"distance": performance})


class DropFoldCloth(DropTask):
    """See the module docstring."""

    def measure(self, state: State, episode: Episode) -> Measures:
        shape, goal = episode.shapes["cloth"], episode.goal["particles"]
        return metrics.fold(shape, state.points["cloth"], goal)


def drop_cloth(
    *,
    actor: str = "picker",
    observation: str | Sequence[str] = "reduced",
    image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
    fidelity: str = "default",
    count_intersections: bool = False,
    sizes: tuple[int, int] = SIZES,
    action_repeat: int | None = None,
    domain: str | Mapping[str, object] = "nominal",
    **actor_settings: Unpack[GripperSettings],
) -> DropCloth:
    """Builds the task.

    Args:
        actor: "picker", "pick_and_place", "franka" or "sawyer".
        observation: a name, or a sequence of names, of `observations.OBSERVATIONS`.
        image_size: (height, width) of images [pixels].
        fidelity: resolution of the cloth: "fast", "default" or "accurate".
        count_intersections: adds "intersections" to info: where the cloth passes through itself.
        sizes: of the sides [particles], the upper end exclusive; the paper's are (60, 120).
        action_repeat: sim steps per env step; None for the usual number.
        domain: what varies besides the initial state: "nominal" for nothing, "in_distribution",
            "out_of_distribution", or a dict of parameters, as in `Domain`.
        **actor_settings: as in `GripperSettings`.
    """
    check_name("actor", actor, ACTORS)
    return DropCloth(
        Cloth(fidelity=fidelity),
        make_actor(actor, "cloth", base_height=BASE_HEIGHT, **actor_settings),
        HangingCloth(fidelity, sizes),
        SUCCESS,
        count_intersections=count_intersections,
        observation=observation,
        image_size=image_size,
        action_repeat=action_repeat_of(actor, action_repeat, ACTION_REPEAT),
        domain=domain,
    )


def drop_fold_cloth(
    *,
    actor: str = "picker",
    observation: str | Sequence[str] = "reduced",
    image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
    fidelity: str = "default",
    count_intersections: bool = False,
    action_repeat: int | None = None,
    domain: str | Mapping[str, object] = "nominal",
    **actor_settings: Unpack[GripperSettings],
) -> DropFoldCloth:
    """Builds the task; arguments as for `drop_cloth`."""
    check_name("actor", actor, ACTORS)
    return DropFoldCloth(
        Cloth(fidelity=fidelity),
        make_actor(actor, "cloth", base_height=BASE_HEIGHT, **actor_settings),
        HangingCloth(fidelity, SIZE_RANGE),
        FOLD_SUCCESS,
        count_intersections=count_intersections,
        observation=observation,
        image_size=image_size,
        action_repeat=action_repeat_of(actor, action_repeat, FOLD_ACTION_REPEAT),
        domain=domain,
    )
