"""FoldCloth and FoldCrumpledCloth (SoftGym: ClothFold, ClothFoldCrumpled): fold a cloth in half.

Goal: columns 0 to half of the cloth, on whose side the pickers start in FoldCloth, on top of their
mirror columns, which stay where they are (FoldCloth) or lie where those of a flat cloth at the
origin do (FoldCrumpledCloth). A strip in the other side's colour marks the half that is folded
over. Two pickers; 100 env steps of 8 sim steps.

Reward = performance: -(mean distance of the pairs) - 1.2 (mean distance of the second half from its
place) [m], over SoftGym's particles.
Bounds: lower = at reset, upper = 0. Two layers of the cloth lie 1 cm apart, so that a perfect fold
scores 0.95 to 0.97.
Reduced state: corners p1 p2 p3 p4 (x, y, z each), picker 0, picker 1: 18 entries [m].
Start: sizes of 60..119 particles a side. FoldCloth: flat, turned by up to 45 degrees; the pickers
start 0.1 m above the middle of column 0. FoldCrumpledCloth: lifted and dropped as in SpreadCloth;
the pickers start 0.2 m above the origin or, as there, higher. The workspace reaches 0.8 m from
there along X and Y, where SoftGym's is too small for 73 % of the folds (facts 5, row 29). End:
horizon only.
"""

from collections.abc import Mapping, Sequence
from typing import Unpack

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.cloth import Cloth
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.factory import GripperSettings, action_repeat_of, make_actor
from softgym_mj.robots.gripper import Gripper, Workspace
from softgym_mj.tasks.cloth_task import ClothInitializer, ClothTask
from softgym_mj.tasks.flex_task import Layout
from softgym_mj.tasks.shared.observations import DEFAULT_IMAGE_SIZE
from softgym_mj.tasks.shared.starts.flexes import CrumpledCloth, FlatCloth
from softgym_mj.tasks.shared.state import Episode, State

ACTION_REPEAT = 8  # Facts 1.2.
WORKSPACE = Workspace((-0.85, -0.85, 0.0), (0.85, 0.85, 0.5))
FOLD_HEIGHT, CRUMPLED_HEIGHT = 0.1, 0.2  # [m] Of the pickers at reset.
SUCCESS = 0.85  # Ours: 4 cm off on average in a cloth of 0.5 m.


class FoldCloth(ClothTask):
    """See the module docstring."""

    def __init__(
        self, cloth: Cloth, actor: Gripper, initializer: ClothInitializer, height: float, **settings
    ):
        """Wires the task; `height` [m] of the pickers at reset, `settings` as in `ClothTask`."""
        layout = Layout("cloth", WORKSPACE, height, SUCCESS)
        super().__init__(layout, cloth, actor, initializer, **settings)

    def reset_point(self) -> tuple[float, float]:
        """The middle of column 0."""
        first, second = self.cloth.corners[:2]
        x, y, _ = (self.cloth.vertex(first) + self.cloth.vertex(second)) / 2
        return float(x), float(y)

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """SoftGym's particles (dimy, dimx, 3) [m] of the unfolded cloth."""
        return {"particles": self.cloth.particles(points["cloth"])}

    def measure(self, state: State, episode: Episode) -> Measures:
        shape, goal = episode.shapes["cloth"], episode.goal["particles"]
        return metrics.fold(shape, state.points["cloth"], goal)

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return episode.initial_performance, 0.0


class FoldCrumpledCloth(FoldCloth):
    """See the module docstring."""

    def reset_point(self) -> tuple[float, float]:
        return 0.0, 0.0

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {"particles": self.cloth.particles(self.cloth.flat())}


def fold_cloth(
    *,
    actor: str = "picker",
    observation: str | Sequence[str] = "reduced",
    image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
    fidelity: str = "default",
    count_intersections: bool = False,
    action_repeat: int | None = None,
    domain: str | Mapping[str, object] = "nominal",
    **actor_settings: Unpack[GripperSettings],
) -> FoldCloth:
    """Builds the task.

    Args:
        actor: "picker", "pick_and_place", "pixel_pick_and_place", "franka" or "sawyer".
        observation: a name, or a sequence of names, of `observations.OBSERVATIONS`.
        image_size: (height, width) of images [pixels].
        fidelity: resolution of the cloth: "fast", "default" or "accurate".
        count_intersections: adds "intersections" to info: where the cloth passes through itself.
        action_repeat: sim steps per env step; None for the usual number.
        domain: what varies besides the initial state: "nominal" for nothing, "in_distribution",
            "out_of_distribution", or a dict of parameters, as in `Domain`.
        **actor_settings: as in `GripperSettings`.
    """
    return FoldCloth(
        Cloth(fidelity=fidelity, marker=True),
        make_actor(actor, "cloth", **actor_settings),
        FlatCloth(fidelity),
        FOLD_HEIGHT,
        count_intersections=count_intersections,
        observation=observation,
        image_size=image_size,
        action_repeat=action_repeat_of(actor, action_repeat, ACTION_REPEAT),
        domain=domain,
    )


def fold_crumpled_cloth(
    *,
    actor: str = "picker",
    observation: str | Sequence[str] = "reduced",
    image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
    fidelity: str = "default",
    count_intersections: bool = False,
    action_repeat: int | None = None,
    domain: str | Mapping[str, object] = "nominal",
    **actor_settings: Unpack[GripperSettings],
) -> FoldCrumpledCloth:
    """Builds the task; arguments as for `fold_cloth`."""
    return FoldCrumpledCloth(
        Cloth(fidelity=fidelity, marker=True),
        make_actor(actor, "cloth", **actor_settings),
        CrumpledCloth(fidelity),
        CRUMPLED_HEIGHT,
        count_intersections=count_intersections,
        observation=observation,
        image_size=image_size,
        action_repeat=action_repeat_of(actor, action_repeat, ACTION_REPEAT),
        domain=domain,
    )
