"""StraightenRope (SoftGym: RopeFlatten): pull a twisted rope straight by its ends.

Goal: the two ends 0.5 m apart, the natural length. Two pickers; 75 env steps of 8 sim steps.

Reward = performance: -|d - 0.5|, d the distance of the end vertices [m].
Bounds: lower = -0.5 (the worst possible, not the start), upper = 0. The initial value lies well
above the lower bound: `initial_normalized_performance` in info.
Reduced state: 10 key points, evenly spaced along the rope (x, y, z each), picker 0, picker 1:
36 entries [m].
Start: dragged four times by a random vertex (facts 3.4). Pickers start 0.1 m above the floor
around the centre of the rope's bounding box. End: horizon only.
"""

from collections.abc import Mapping, Sequence
from typing import Unpack

from softgym_mj import metrics
from softgym_mj.entities.rope import LENGTH, Rope
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.factory import GripperSettings, action_repeat_of, make_actor
from softgym_mj.robots.gripper import Gripper, Workspace
from softgym_mj.tasks.flex_task import FlexTask, Layout
from softgym_mj.tasks.shared.observations import DEFAULT_IMAGE_SIZE
from softgym_mj.tasks.shared.starts.flexes import TwistedRope
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.variations.store import VariationStore

ACTION_REPEAT = 8  # Facts 1.2.
WORKSPACE = Workspace((-0.35, -0.35, 0.0), (0.35, 0.35, 0.3))  # Facts 2.2.
RESET_HEIGHT = 0.1  # [m]
SUCCESS = 0.95  # Ours: ends within 2.5 cm of the natural length.


class StraightenRope(FlexTask):
    """See the module docstring."""

    def __init__(self, rope: Rope, actor: Gripper, initializer: TwistedRope, **settings):
        """Wires the task; `settings` as in `FlexTask`."""
        self._rope = rope
        super().__init__(
            Layout("rope", WORKSPACE, RESET_HEIGHT, SUCCESS),
            rope,
            actor,
            VariationStore(initializer),
            max_vertices=rope.num_vertices,
            **settings,
        )

    @property
    def rope(self) -> Rope:
        """The rope."""
        return self._rope

    def measure(self, state: State, episode: Episode) -> Measures:
        points = state.points["rope"]
        distance = metrics.distance(points[..., 0, :], points[..., -1, :])
        performance = -abs(distance - LENGTH)
        return Measures(
            performance,
            rewards={"end_distance_error": performance},
            info={"end_point_distance": distance},
        )

    def diagnostics(self) -> dict[str, float | int]:
        initial = self.normalized(self.episode.initial_performance)
        return {**super().diagnostics(), "initial_normalized_performance": initial}

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return -LENGTH, 0.0

    def reduced(self, state: State, episode: Episode) -> dict[str, Array]:
        keys = self._rope.key_points
        return {f"{len(keys)} key points (x, y, z each) [m]": state.points["rope"][..., keys, :]}


def straighten_rope(
    *,
    actor: str = "picker",
    observation: str | Sequence[str] = "reduced",
    image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
    fidelity: str = "default",
    action_repeat: int | None = None,
    domain: str | Mapping[str, object] = "nominal",
    **actor_settings: Unpack[GripperSettings],
) -> StraightenRope:
    """Builds the task.

    Args:
        actor: "picker", "pick_and_place", "pixel_pick_and_place", "franka" or "sawyer".
        observation: a name, or a sequence of names, of `observations.OBSERVATIONS`.
        image_size: (height, width) of images [pixels].
        fidelity: number of vertices: "fast", "default" or "accurate".
        action_repeat: sim steps per env step; None for the usual number.
        domain: what varies besides the initial state: "nominal" for nothing, "in_distribution",
            "out_of_distribution", or a dict of parameters, as in `Domain`.
        **actor_settings: as in `GripperSettings`.
    """
    return StraightenRope(
        Rope(fidelity),
        make_actor(actor, "rope", **actor_settings),
        TwistedRope(fidelity),
        observation=observation,
        image_size=image_size,
        action_repeat=action_repeat_of(actor, action_repeat, ACTION_REPEAT),
        domain=domain,
    )
