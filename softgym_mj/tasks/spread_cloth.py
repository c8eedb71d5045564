"""SpreadCloth (SoftGym: ClothFlatten): spread a crumpled cloth on the floor.

Goal: cover as much floor as possible. Two pickers; 100 env steps of 8 sim steps.

Reward = performance: covered area in top view [m^2].
Bounds: lower = area at reset; upper = area of the flat cloth, (dimx - 1)(dimy - 1) rho^2, measured
by the same rule as the value, so that a flat cloth scores 1 in every orientation. SoftGym's bound
adds half a particle of border on every side and its value only along the axes (facts 5, row 35).
Reduced state: corners p1 p2 p3 p4 (x, y, z each), picker 0, picker 1: 18 entries [m].
Start: sizes of 60..119 particles a side; lifted 0.5..1 m at a random vertex and dropped.
Pickers start 0.2 m above the centre of the cloth's bounding box. End: horizon only.
"""

from collections.abc import Sequence

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.cloth import Cloth, grid_shape
from softgym_mj.observations import DEFAULT_IMAGE_SIZE
from softgym_mj.robots.factory import make_gripper
from softgym_mj.robots.gripper import Gripper, Workspace
from softgym_mj.tasks.base import Evaluation
from softgym_mj.tasks.flex_task import FlexTask, Layout
from softgym_mj.tasks.initializers import SIZE_RANGE, CrumpledCloth
from softgym_mj.variations import VariationStore

ACTION_REPEAT = 8  # Facts 1.2.
WORKSPACE = Workspace((-0.7, -0.4, 0.0), (0.7, 0.4, 0.5))  # Facts 2.2.
RESET_HEIGHT = 0.2  # [m]
SUCCESS = 0.9  # Ours: a spread cloth with a few flat wrinkles or one small tucked corner.


class SpreadCloth(FlexTask):
    """See the module docstring."""

    def __init__(
        self,
        cloth: Cloth,
        actor: Gripper,
        initializer: CrumpledCloth,
        count_intersections: bool = False,
        **settings,
    ):
        """Wires the task; `settings` as in `FlexTask`."""
        self._initializer = initializer
        self._cloth = cloth
        self._count_intersections = count_intersections
        largest = SIZE_RANGE[1] - 1
        rows, columns = grid_shape((largest, largest), initializer.fidelity)
        layout = Layout("cloth", WORKSPACE, RESET_HEIGHT, SUCCESS, max_vertices=rows * columns)
        super().__init__(layout, cloth, actor, VariationStore(initializer), **settings)

    @property
    def cloth(self) -> Cloth:
        return self._cloth

    def resize(self, variation: int) -> bool:
        return self._cloth.resize(self._initializer.dims(variation))

    def evaluate(self) -> Evaluation:
        area = metrics.covered_area(self._cloth.vertices(), self._cloth.triangles)
        return Evaluation(performance=area, reward_terms={"covered_area": area}, measures={})

    def bounds(self) -> tuple[float, float]:
        width, depth = self._cloth.size
        return self.initial_performance, width * depth

    def diagnostics(self) -> dict[str, float | int]:
        diagnostics = super().diagnostics()
        if self._count_intersections:
            diagnostics["intersections"] = self._cloth.intersections()
        return diagnostics

    def key_points(self) -> np.ndarray:
        return self._cloth.vertices()[self._cloth.corners]


def spread_cloth(
    *,
    actor: str = "picker",
    num_pickers: int = 2,
    observation: str | Sequence[str] = "reduced",
    image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
    fidelity: str = "default",
    self_contact: str = "plugin",
    count_intersections: bool = False,
    action_repeat: int = ACTION_REPEAT,
) -> SpreadCloth:
    """Builds the task.

    Args:
        actor: "picker".
        num_pickers: number of pickers.
        observation: "full", "reduced", "rgb" or a sequence of these.
        image_size: (height, width) of images [pixels].
        fidelity: resolution of the cloth: "fast", "default" or "accurate".
        self_contact: "plugin", "mujoco" or "none", as in `Cloth`.
        count_intersections: adds "intersections" to info: where the cloth passes through itself.
        action_repeat: sim steps per env step.
    """
    cloth = Cloth(fidelity=fidelity, self_contact=self_contact)
    return SpreadCloth(
        cloth,
        make_gripper(actor, "cloth", num_pickers),
        CrumpledCloth(fidelity),
        count_intersections,
        observation=observation,
        image_size=image_size,
        action_repeat=action_repeat,
    )
