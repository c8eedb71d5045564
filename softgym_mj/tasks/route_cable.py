"""The task RouteCable: a rope around pegs and through clips, beyond SoftGym."""

import functools
import math
from typing import NamedTuple, Unpack

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.rope import LENGTH, RADIUS, Rope
from softgym_mj.exceptions import check_name
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.workspace import ToolStart, Workspace
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.entries import Entries, points
from softgym_mj.tasks.shared.guidance import guided
from softgym_mj.tasks.shared.settings import TaskSettings
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.shared.symmetry import anywhere
from softgym_mj.variations.indices import generator

# Amplitudes and wavelengths of routes [m], by name of a category.
ROUTES = {
    "usual": ((0.015, 0.028), (0.2, 0.26)),
    "unseen": ((0.032, 0.038), (0.18, 0.19)),
}
PEGS = 3
PEG_RADIUS, HEIGHT = 0.008, 0.025  # [m] Radius and height of pegs; clips are as high.
GAP, JAW, END = 0.028, (0.01, 0.002), 0.06  # [m] Clips: gap, half sizes, distance from an end.
BESIDE = 0.03  # [m] Width of the gate beside a peg, in which the rope passes it.
REACH = 0.025  # [m] Distance from which a gate counts: a rope behind the peg is farther away.
DRAWN = 2001  # Points in which routes are drawn.
DENSE = 4  # Points per segment of the rope, for its distances from gates.
SLACK = 0.002  # [m] Half the spacing of these points, which is subtracted from the distances.
START_Y, START_SHIFT, START_ANGLE = -0.16, 0.02, math.pi / 12  # [m], [rad] Where the rope starts.
WOOD = (0.85, 0.45, 0.12, 1.0)


class _Wave(NamedTuple):
    """Wave of a route: side of its middle, amplitude and length [m], and points (DRAWN,) [m]."""

    side: float
    amplitude: float
    length: float
    x: np.ndarray
    y: np.ndarray
    along: np.ndarray  # Arc length from the first point.


@functools.lru_cache(maxsize=1)  # A reset needs it several times.
def _wave(routes: str, variation: int) -> _Wave:
    """Returns the wave of a variation; `routes` is a category."""
    random = generator("route_cable", variation)
    amplitude, length = (float(random.uniform(*ends)) for ends in ROUTES[routes])
    side = float(random.choice([-1.0, 1.0]))
    x = np.linspace(-LENGTH / 2, LENGTH / 2, DRAWN)
    waves = [math.cos(2.0 * math.pi * each / length) for each in x.tolist()]
    y = side * amplitude * np.array(waves)
    steps = np.sqrt(np.diff(x) ** 2 + np.diff(y) ** 2)
    return _Wave(side, amplitude, length, x, y, np.concatenate([[0.0], np.cumsum(steps)]))


class RouteCable(Task):
    """Route a rope around pegs and through clips.

    Goal: the rope passes three pegs on alternate sides and lies in a clip near each end, in either
    direction.
    Actions: per picker dx, dy, dz (1 is 0.01 m per sim step) and grip (closes if > 0), each in [-1,
    1].
    Observations: `reduced` (default) lists 10 key points of the rope, the ends of 5 gates that it
    has to pass, from left to right, and picker 0, picker 1 (x, y, z each): 66 entries [m].
    `OBSERVATIONS` of `tasks.shared.observations` lists the others.
    Reward = p + (1 - p) a / 2. Performance p: mean over the gates of 1 - d / 2.5 cm, at least 0,
    with the distance d of the rope from the gate: a segment on the table beside a peg or across a
    clip. Approach a = 1 - (mean of d) / (mean of d at the start).
    Bounds: lower = 0 (the start), upper = 1 (all gates).
    Horizon: 100 env steps of 8 sim steps; nothing else ends an episode.
    Start: the rope lies straight 0.14 to 0.18 m beside the pegs, rotated by up to 15 degrees. The
    route is a wave with an amplitude of 15 to 28 mm and a length of 0.2 to 0.26 m; with
    `routes="unseen"` 32 to 38 mm and 0.18 to 0.19 m.
    """

    summary = "Route a rope around pegs and through clips."
    difficulty, material = "hard", "rope"
    success = 0.9  # Half of one of the five gates may be missing.
    workspace = Workspace((-0.4, -0.35, 0.0), (0.4, 0.35, 0.3))
    reset_height, view = 0.1, "route_cable"
    symmetries = anywhere("same", "reversed")

    def __init__(
        self, *, fidelity: str = "default", routes: str = "usual", **settings: Unpack[TaskSettings]
    ):
        """Builds the task.

        Args:
            fidelity: resolution of the rope: "fast", "default" or "accurate".
            routes: amplitudes and wavelengths of routes: "usual", or "unseen", which are narrower
                and wind more, to measure generalization.
            **settings: entries of `TaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        check_name("routes", routes, ROUTES)
        self._routes = routes
        self.rope = Rope(fidelity)
        super().__init__([self.rope], **settings)
        add = self.root_entity.add_solid
        size = [PEG_RADIUS, HEIGHT / 2]
        self._pegs = [add("cylinder", name=f"peg_{i}", size=size, rgba=WOOD) for i in range(PEGS)]
        size = [*JAW, HEIGHT / 2]
        self._jaws = [add("box", name=f"jaw_{i}", size=size, rgba=WOOD) for i in range(4)]
        self._placed = -1
        self.resize(0)

    def route(self, variation: int, number: int) -> np.ndarray:
        """Returns evenly spaced points (number, 2) [m] of the route of a variation."""
        wave = _wave(self._routes, variation)
        places = (wave.along[-1] - LENGTH) / 2 + np.linspace(0.0, LENGTH, number)
        return np.column_stack([np.interp(places, wave.along, axis) for axis in (wave.x, wave.y)])

    def gates(self, variation: int) -> np.ndarray:
        """Returns the ends of the gates (5, 2, 2) [m] of a variation, from left to right.

        The first end of a gate at a peg touches the rope's middle when it touches the peg.
        """
        wave, found = _wave(self._routes, variation), []
        for k in range(PEGS):
            x, outside = (k - 1) * wave.length / 2, wave.side * (1.0 if k == 1 else -1.0)
            found.append([(x, outside * wave.amplitude), (x, outside * (wave.amplitude + BESIDE))])
        clips = []
        for middle, across in self._clips(variation):
            half = GAP / 2 - JAW[1] - RADIUS
            clips.append([middle - half * across, middle + half * across])
        return np.array([clips[0], *found, clips[1]])

    def _clips(self, variation: int) -> list[tuple[np.ndarray, np.ndarray]]:
        """Returns middles and directions across (2,) of the two clips."""
        route, at = self.route(variation, DRAWN), round(END / LENGTH * (DRAWN - 1))
        clips = []
        for i in (at, DRAWN - 1 - at):
            x, y = (route[i + 1] - route[i - 1]).tolist()
            clips.append((route[i], np.array([-y, x]) / math.sqrt(x * x + y * y)))
        return clips

    def resize(self, variation: int) -> bool:
        resized = super().resize(variation)
        if self._placed == variation:
            return resized
        self._placed = variation
        for peg, gate in zip(self._pegs, self.gates(variation)[1:-1], strict=True):
            inside = gate[0] - (PEG_RADIUS + RADIUS) / BESIDE * (gate[1] - gate[0])
            peg.pos = [*inside, HEIGHT / 2]
        jaws = iter(self._jaws)
        for middle, across in self._clips(variation):
            angle = math.atan2(-across[0], across[1]) / 2
            for sign in (-1.0, 1.0):
                jaw = next(jaws)
                jaw.pos = [*(middle + sign * GAP / 2 * across), HEIGHT / 2]
                jaw.quat = [math.cos(angle), 0.0, 0.0, math.sin(angle)]
        return True

    def arrange(self, random: np.random.Generator) -> None:
        angle = random.uniform(-START_ANGLE, START_ANGLE)
        y = START_Y + random.uniform(-START_SHIFT, START_SHIFT)
        along, ones = self.rope.straight()[:, 0], np.ones(self.rope.num_points)
        self.rope.set_points(
            np.column_stack(
                [math.cos(angle) * along, y + math.sin(angle) * along, self.rope.radius * ones]
            )
        )

    def tool_start(self, points: dict[str, np.ndarray]) -> ToolStart:
        return ToolStart((0.0, START_Y / 2, self.reset_height), self.workspace)

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Returns places [m] on the table.

        They are the ends of the "gates" (5, 2, 3), the rope on its route "rope" (n, 3), and the
        mean distance of the rope from the gates at the "start" ().
        """
        gates, route = self.gates(variation), self.route(variation, self.rope.num_points)
        height = np.full((*gates.shape[:2], 1), self.rope.radius)
        gates = np.concatenate([gates, height], axis=-1)
        return {
            "gates": gates,
            "start": np.array(gate_distances(points["rope"], gates).mean()),
            "rope": np.column_stack([route, np.full(len(route), self.rope.radius)]),
        }

    def measure(self, state: State, episode: Episode) -> Measures:
        away = gate_distances(state.points["rope"], episode.goal["gates"])
        xp = metrics.namespace(away)
        near = xp.clip(1.0 - away / REACH, 0.0, 1.0)
        performance = xp.mean(near, axis=-1)
        passed = xp.mean(xp.astype(away <= 0.0, xp.float64), axis=-1)
        approach = 1.0 - xp.mean(away, axis=-1) / episode.goal["start"]
        return guided("near_gates", performance, approach, {"gates_passed": passed})

    def reduced(self, state: State, episode: Episode) -> Entries:
        rope, gates = state.points["rope"], episode.goal["gates"]
        ends = gates.reshape((*gates.shape[:-3], 2 * gates.shape[-3], 3))
        keys = self.rope.key_points
        return {
            f"{len(keys)} key points of the rope": points(metrics.chosen(rope, keys), "object"),
            "10 ends of gates": points(ends, "goal"),
        }


def gate_distances(rope: Array, gates: Array) -> Array:
    """Returns the distances (..., k) [m] of a rope from gates, at least 0.

    Args:
        rope: (..., n, 3) vertices [m].
        gates: (..., k, 2, 3) ends [m].
    """
    xp = metrics.namespace(rope)
    shares = metrics.constant(np.arange(DENSE) / DENSE, rope)[:, None]
    first, last = rope[..., :-1, None, :], rope[..., 1:, None, :]
    dense = first + shares * (last - first)
    dense = dense.reshape((*rope.shape[:-2], DENSE * (rope.shape[-2] - 1), 3))
    start, along = gates[..., 0, :], gates[..., 1, :] - gates[..., 0, :]
    away = dense[..., None, :, :] - start[..., None, :]
    square = xp.sum(along * along, axis=-1)[..., None]
    share = xp.clip(xp.sum(away * along[..., None, :], axis=-1) / square, 0.0, 1.0)
    nearest = metrics.lengths(away - share[..., None] * along[..., None, :])
    return xp.clip(xp.min(nearest, axis=-1) - SLACK, 0.0, None)
