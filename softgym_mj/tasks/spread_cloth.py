"""SpreadCloth (SoftGym: ClothFlatten): spread a crumpled cloth on the floor.

Goal: cover as much floor as possible. Two pickers; 100 env steps of 8 sim steps.

Reward = performance: covered area in top view [m^2].
Bounds: lower = area at reset; upper = area of the flat cloth, (dimx - 1)(dimy - 1) rho^2, measured
by the same rule as the value, so that a flat cloth scores 1 in every orientation. SoftGym's bound
has half a particle of border on every side, which its value leaves out of a cloth that lies along
the axes (facts 5, row 35).
Reduced state: corners p1 p2 p3 p4 (x, y, z each), picker 0, picker 1: 18 entries [m].
Start: sizes of 60..119 particles a side; lifted 0.5..1 m at a random vertex and dropped.
Pickers start 0.2 m above the centre of the cloth's bounding box, higher where a heap is as high:
ours are higher than SoftGym's. End: horizon only.
"""

from collections.abc import Mapping, Sequence
from typing import Unpack

from softgym_mj import metrics
from softgym_mj.entities.cloth import Cloth
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.factory import GripperSettings, action_repeat_of, make_actor
from softgym_mj.robots.gripper import Gripper, Workspace
from softgym_mj.tasks.cloth_task import ClothTask
from softgym_mj.tasks.flex_task import Layout
from softgym_mj.tasks.shared.observations import DEFAULT_IMAGE_SIZE
from softgym_mj.tasks.shared.starts.flexes import CrumpledCloth
from softgym_mj.tasks.shared.state import Episode, State

ACTION_REPEAT = 8  # Facts 1.2.
WORKSPACE = Workspace((-0.7, -0.4, 0.0), (0.7, 0.4, 0.5))  # Facts 2.2.
RESET_HEIGHT = 0.2  # [m]
SUCCESS = 0.9  # Ours: a spread cloth with a few flat wrinkles or one small tucked corner.


class SpreadCloth(ClothTask):
    """See the module docstring."""

    def __init__(self, cloth: Cloth, actor: Gripper, initializer: CrumpledCloth, **settings):
        """Wires the task; `settings` as in `ClothTask`."""
        layout = Layout("cloth", WORKSPACE, RESET_HEIGHT, SUCCESS)
        super().__init__(layout, cloth, actor, initializer, **settings)

    def measure(self, state: State, episode: Episode) -> Measures:
        triangles = episode.shapes["cloth"]["triangles"]
        area = metrics.covered_area(state.points["cloth"], triangles)
        return Measures(area, rewards={"covered_area": area})

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        size = episode.shapes["cloth"]["size"]
        return episode.initial_performance, size[..., 0] * size[..., 1]


def spread_cloth(
    *,
    actor: str = "picker",
    observation: str | Sequence[str] = "reduced",
    image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
    fidelity: str = "default",
    count_intersections: bool = False,
    action_repeat: int | None = None,
    domain: str | Mapping[str, object] = "nominal",
    **actor_settings: Unpack[GripperSettings],
) -> SpreadCloth:
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
    cloth = Cloth(fidelity=fidelity)
    return SpreadCloth(
        cloth,
        make_actor(actor, "cloth", **actor_settings),
        CrumpledCloth(fidelity),
        count_intersections=count_intersections,
        observation=observation,
        image_size=image_size,
        action_repeat=action_repeat_of(actor, action_repeat, ACTION_REPEAT),
        domain=domain,
    )
