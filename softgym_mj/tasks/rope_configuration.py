"""RopeConfiguration: lay a twisted rope in the shape of a letter.

Goal: the rope on the letter S, O, M, C or U that is drawn on the floor about the origin, whichever
end is where. Two pickers; 100 env steps of 8 sim steps.

Reward = performance: -(mean distance of the key points to those of the goal, matched so that it is
smallest) [m]; all vertices instead of the 10 key points with `matching="vertices"`.
Bounds: lower = at reset, upper = 0. The goal lies at the rope's own height and is as long as the
rope, so that it can be reached; SoftGym's hovers 5 cm above the floor (facts 5, rows 23 and 24).
Reduced state: 10 key points of the rope, 10 of the goal, evenly spaced (x, y, z each), picker 0,
picker 1: 66 entries [m]. Full state: all vertices, then those of the goal, then the pickers.
The observation "goal_rgb" is the task camera's image with the rope on the letter.
Start: as in StraightenRope. End: horizon only.
"""

from collections.abc import Mapping, Sequence
from typing import Unpack

import numpy as np
from dm_control.composer.observation import observable
from dm_env import specs

from softgym_mj import metrics
from softgym_mj.entities.marks import GoalLine
from softgym_mj.entities.rope import Rope
from softgym_mj.exceptions import check_name
from softgym_mj.metrics import Array, Measures
from softgym_mj.rendering.observables import Seen
from softgym_mj.rendering.offscreen import CameraView, refresh_poses
from softgym_mj.robots.factory import GripperSettings, action_repeat_of, make_actor
from softgym_mj.robots.gripper import Gripper, Workspace
from softgym_mj.tasks.flex_task import FlexTask, Layout
from softgym_mj.tasks.shared.letters import LETTERS, letter
from softgym_mj.tasks.shared.observations import DEFAULT_IMAGE_SIZE, GOAL_RGB
from softgym_mj.tasks.shared.starts.flexes import TwistedRope
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.variations.indices import generator
from softgym_mj.variations.store import VariationStore

ACTION_REPEAT = 8  # Facts 1.2.
WORKSPACE = Workspace((-0.35, -0.35, 0.0), (0.35, 0.35, 0.3))  # Facts 2.2.
RESET_HEIGHT = 0.1  # [m]
HIDDEN_GROUP = 5  # Of geoms that are not drawn: the actor's, while the goal is.
SUCCESS = 0.8  # Ours: key points within 1 to 3 cm of the letter on average.
MATCHINGS = ("key_points", "vertices")


def goal_name(variation: int) -> str:
    """The letter of a variation; each is as likely as the others."""
    return LETTERS[int(generator("rope_configuration", variation).integers(len(LETTERS)))]


class RopeConfiguration(FlexTask):
    """See the module docstring."""

    def __init__(
        self, rope: Rope, actor: Gripper, initializer: TwistedRope, matching: str, **settings
    ):
        """Wires the task; `matching` is one of `MATCHINGS`, `settings` as in `FlexTask`."""
        check_name("matching", matching, MATCHINGS)
        self._rope, self._line = rope, GoalLine(rope.num_vertices)
        every = np.arange(rope.num_vertices)
        self._matched = rope.key_points if matching == "key_points" else every
        self._goal_rgb: np.ndarray | None = None
        super().__init__(
            Layout("rope", WORKSPACE, RESET_HEIGHT, SUCCESS),
            rope,
            actor,
            VariationStore(initializer),
            max_vertices=rope.num_vertices,
            **settings,
        )
        self.root_entity.attach(self._line)

    @property
    def rope(self) -> Rope:
        """The rope."""
        return self._rope

    def _place(self, name: str) -> np.ndarray:
        """Where the vertices (n, 3) [m] of the rope ought to lie."""
        places = letter(name, self._rope.num_vertices)
        return np.column_stack([places, np.full(len(places), self._rope.radius)])

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Where the vertices (n, 3) [m] ought to lie, from either end."""
        return {"rope": self._place(goal_name(variation))}

    def show(self, goal: dict[str, np.ndarray]) -> None:
        self._goal_rgb = None
        self._line.draw(goal["rope"][:, :2])

    @property
    def parts(self) -> dict[str, tuple[str, ...]]:
        return {**super().parts, "goal": (self._line.mjcf_model.model,)}

    def own_observables(self, height: int, width: int) -> dict[str, observable.Observable]:
        seen = specs.BoundedArray((height, width, 3), np.uint8, 0, 255)
        return {GOAL_RGB: Seen(lambda physics: self._shown_goal(physics, height, width), seen)}

    def _shown_goal(self, physics, height: int, width: int) -> np.ndarray:
        """The goal image of the episode, drawn once."""
        if self._goal_rgb is None:
            self._goal_rgb = self.goal_image(physics, height, width)
        return self._goal_rgb.copy()

    def goal_image(
        self, physics, height: int = DEFAULT_IMAGE_SIZE[0], width: int = DEFAULT_IMAGE_SIZE[1]
    ) -> np.ndarray:
        """What the task's camera sees when the goal is reached (height, width, 3) uint8.

        The actor is not in the picture. Nothing is simulated, and the state stays as it is.
        """
        model, data = physics.model.ptr, physics.data.ptr
        qpos, qvel, groups = data.qpos.copy(), data.qvel.copy(), model.geom_group.copy()
        for geom in range(model.ngeom):
            if model.geom(geom).name.split("/")[0] in self._actor.model_names:
                model.geom_group[geom] = HIDDEN_GROUP
        self._rope.set_vertices(self.episode.goal["rope"])
        image = CameraView("task", height, width).rgb(physics)
        data.qpos[:], data.qvel[:], model.geom_group[:] = qpos, qvel, groups
        refresh_poses(physics)
        return image

    def measure(self, state: State, episode: Episode) -> Measures:
        points, goal = state.points["rope"], episode.goal["rope"]
        matched = (points[..., self._matched, :], goal[..., self._matched, :])
        performance = -metrics.matched_distance(*matched)
        return Measures(performance, rewards={"matched_distance": performance})

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return episode.initial_performance, 0.0

    def reduced(self, state: State, episode: Episode) -> dict[str, Array]:
        keys, places = self._rope.key_points, {"rope": state.points, "goal": episode.goal}
        return {
            f"{len(keys)} key points of the {name} (x, y, z each) [m]": place["rope"][..., keys, :]
            for name, place in places.items()
        }

    def beside(self, state: State, episode: Episode) -> dict[str, Array]:
        goal = episode.goal["rope"]
        return {f"{goal.shape[-2]} vertices of the goal (x, y, z each) [m]": goal}


def rope_configuration(
    *,
    actor: str = "picker",
    observation: str | Sequence[str] = "reduced",
    image_size: tuple[int, int] = DEFAULT_IMAGE_SIZE,
    fidelity: str = "default",
    matching: str = "key_points",
    action_repeat: int | None = None,
    domain: str | Mapping[str, object] = "nominal",
    **actor_settings: Unpack[GripperSettings],
) -> RopeConfiguration:
    """Builds the task.

    Args:
        actor: "picker", "pick_and_place", "pixel_pick_and_place", "franka" or "sawyer".
        observation: a name, or a sequence of names, of `observations.OBSERVATIONS`.
        image_size: (height, width) of images [pixels].
        fidelity: number of vertices: "fast", "default" or "accurate".
        matching: what the reward matches: 10 "key_points" or all "vertices".
        action_repeat: sim steps per env step; None for the usual number.
        domain: what varies besides the initial state: "nominal" for nothing, "in_distribution",
            "out_of_distribution", or a dict of parameters, as in `Domain`.
        **actor_settings: as in `GripperSettings`.
    """
    return RopeConfiguration(
        Rope(fidelity),
        make_actor(actor, "rope", **actor_settings),
        TwistedRope(fidelity),
        matching,
        observation=observation,
        image_size=image_size,
        action_repeat=action_repeat_of(actor, action_repeat, ACTION_REPEAT),
        domain=domain,
    )
