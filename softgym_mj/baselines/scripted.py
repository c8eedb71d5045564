"""Scripted experts: what a hand-written policy reaches that sees the whole state.

They read positions straight from the task, so they are no baseline for learning but a proof that
the tasks can be solved with the pickers. Each is a generator of actions over the steps of an
episode; all are deterministic.
"""

from collections.abc import Callable, Iterator

import dm_env
import numpy as np

from softgym_mj.environment import Environment
from softgym_mj.exceptions import OutOfRangeError, check_name
from softgym_mj.robots.base import SIM_STEP  # noqa: F401
from softgym_mj.robots.picker import MAX_DISPLACEMENT

ARRIVED = 0.003  # [m] Distance at which a goal counts as reached.
PASSED = 0.05  # [m] The same for a point to be passed on the way.


class Expert:
    """Moves two pickers; subclasses write an episode as a generator of actions."""

    def __init__(self, env: Environment):
        """Binds the expert.

        Args:
            env: environment of the expert's task with two pickers.

        Raises:
            OutOfRangeError: for another number of grippers.
        """
        self._env = env
        self._actor, self._target = env.task.actor, env.task.target
        if self._actor.num_grippers != 2:
            raise OutOfRangeError("num_grippers", self._actor.num_grippers, "2")
        self._reach = MAX_DISPLACEMENT * env.task.action_repeat
        self._plan = self._episode()

    def __call__(self, timestep: dm_env.TimeStep) -> np.ndarray:
        """The action (8,) in [-1, 1] for a time step."""
        if timestep.first():
            self._plan = self._episode()
        return next(self._plan)

    def _episode(self) -> Iterator[np.ndarray]:
        """Endless actions of an episode."""
        raise NotImplementedError

    def _step(self, goals: np.ndarray, grips, speed: float = 1.0) -> np.ndarray:
        """Action that moves the pickers straight towards `goals` (2, 3) [m].

        Args:
            goals: picker centres, clipped to the workspace.
            grips: two flags, true to hold.
            speed: largest fraction of the pickers' speed along an axis.
        """
        delta = (np.clip(goals, *self._actor.limits) - self._actor.positions()) / self._reach
        delta *= speed / max(np.abs(delta).max(), speed)
        grip = np.where(grips, 1.0, -1.0)
        return np.column_stack([delta, grip]).ravel()

    def _move(
        self, goals, grips, speed: float = 1.0, near: float = ARRIVED
    ) -> Iterator[np.ndarray]:
        """Actions until the pickers are within `near` [m] of `goals`."""
        goals = np.clip(goals, *self._actor.limits)
        while np.abs(goals - self._actor.positions()).max() >= near:
            yield self._step(goals, grips, speed)

    def _wait(self, grips, steps: int = 1) -> Iterator[np.ndarray]:
        """Actions that stay in place for `steps` env steps."""
        for _ in range(steps):
            yield self._step(self._actor.positions(), grips)


ROPE_APPROACH = 0.1  # [m] Height of the picker centres above the ends before they go down.
ROPE_GRASP = (0.008, 0.036)  # [m] Grasp point beyond the end along the rope and above it.
ROPE_LIFT = 0.1  # [m] Height at which the rope is pulled.
ROPE_SLOW = 0.3  # Fraction of full speed at which the rope is pulled.


class StraightenRope(Expert):
    """Takes both ends from above, pulls them apart and lays the rope down."""

    def _episode(self):
        rope = self._env.task.rope
        ends = np.array(rope.ends)
        inner = np.array([ends[0] + 2, ends[1] - 2])
        if _crosses(self._actor.positions(), self._target.vertices()[ends]):
            ends, inner = ends[::-1], inner[::-1]
        for _ in range(4):
            up = self._actor.positions()
            up[:, 2] = ROPE_APPROACH
            yield from self._move(up, (0, 0))
            vertices = self._target.vertices()
            tangent = vertices[ends] - vertices[inner]
            tangent[:, 2] = 0.0
            tangent /= np.linalg.norm(tangent, axis=1, keepdims=True) + 1e-9
            grasp = vertices[ends] + ROPE_GRASP[0] * tangent + [0.0, 0.0, ROPE_GRASP[1]]
            above = grasp.copy()
            above[:, 2] = ROPE_APPROACH
            yield from self._move(above, (0, 0))
            yield from self._move(grasp, (0, 0), 0.5)
            yield from self._wait((1, 1))
            if np.all(np.isin(self._actor.held, ends)):
                break
            print(self._actor.held, ends)
        low, high = self._actor.limits
        centre = (low + high) / 2
        natural = 0.5
        lifted = self._actor.positions()
        lifted[:, 2] = ROPE_LIFT
        yield from self._move(lifted, (1, 1), 0.5)
        for _ in range(40):
            a, b = self._target.vertex(ends[0]), self._target.vertex(ends[1])
            error = natural - rope.end_distance()
            if abs(error) < 0.001:
                break
            line = a - b
            line[2] = 0
            line /= np.linalg.norm(line)
            p = self._actor.positions()
            mid = p.mean(axis=0)
            goals = np.array([p[0] + line * error / 2, p[1] - line * error / 2])
            shift = np.array([*(centre - mid)[:2], 0])
            yield self._step(goals + shift, (1, 1), ROPE_SLOW)
        down = self._actor.positions()
        down[:, 2] = ROPE_GRASP[1]
        yield from self._move(down, (1, 1), ROPE_SLOW)
        while True:
            yield from self._wait((1, 1))


def _crosses(starts, goals) -> bool:
    """Whether exchanging the goals (2, 3) shortens the way from the starts (2, 3)."""
    direct = np.linalg.norm(starts - goals, axis=1).sum()
    return np.linalg.norm(starts - goals[::-1], axis=1).sum() < direct


CLOTH_REACH = (
    0.059  # [m] Distance from picker centre to the vertex to be taken: 4 mm off the cloth.
)
STANDOFF = 0.06  # [m] Further distance at which an approach starts.
TRAVEL_HEIGHT = 0.25  # [m] Height of the picker centres between places, above every heap.
PACE = 0.06
LIFT = 0.8
SLOW = 0.5  # Fraction of full speed while a cloth is stretched.


def _directions() -> np.ndarray:
    """Approach directions (n, 3) over the upper half-sphere, the steepest first."""
    rows = [(np.pi / 2, 1)] + [(np.deg2rad(e), 12) for e in (70, 52, 35, 18, 0)]
    return np.array(
        [
            (np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e))
            for e, n in rows
            for a in 2 * np.pi * np.arange(n) / n
        ]
    )


class SpreadCloth(Expert):
    """Takes two adjacent corners, drags the cloth out, then pulls the other places right."""

    _DIRECTIONS = _directions()

    def _grasp(self, vertex: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Where to take a vertex: picker centre (3,) [m], direction (3,) and clearance [m].

        The clearance is how much further than the vertex its nearest competitor is, not counting
        those next to it in the sheet.
        """
        vertices = self._target.vertices()
        low, high = self._actor.limits
        centres = vertices[vertex] + CLOTH_REACH * self._DIRECTIONS
        inside = np.clip(centres, low, high)
        distance = np.linalg.norm(inside[:, None] - vertices, axis=2)
        own = distance[:, vertex].copy()
        distance[:, vertex] = np.inf
        clearance = distance.min(axis=1) - own
        clearance[own > self._actor.pick_distance] = -1.0
        best = int(np.argmax(np.minimum(clearance, 0.005)))
        return inside[best], self._DIRECTIONS[best], float(clearance[best])

    def _take(self, pickers, vertices, grips, tries: int = 2):
        """Takes `vertices` with `pickers`, others keep `grips`; grips (2,) is changed."""
        for _ in range(tries):
            todo = [(i, v) for i, v in zip(pickers, vertices) if not grips[i]]
            if not todo:
                return
            up = self._actor.positions()
            for i, _ in todo:
                up[i, 2] = max(TRAVEL_HEIGHT, up[i, 2])
            yield from self._move(up, grips, near=PASSED)
            for stage in (0, 1, 2):
                goals = self._actor.positions()
                for i, v in todo:
                    centre, direction, _ = self._grasp(v)
                    goals[i] = centre + STANDOFF * direction * (stage < 2)
                    if stage == 0:
                        goals[i, 2] = up[i, 2]
                yield from self._move(
                    goals, grips, 1.0 if stage < 2 else SLOW, ARRIVED if stage else PASSED
                )
            for i, _ in todo:
                grips[i] = 1
            yield from self._wait(grips)
            held = self._actor.held
            for i, v in todo:
                if held[i] < 0 or self._grid_distance(held[i], v) > 2:
                    grips[i] = 0

    def _grid_distance(self, a: int, b: int) -> int:
        columns = self._env.task.cloth.shape[1]
        return max(abs(a // columns - b // columns), abs(a % columns - b % columns))

    def _pairs(self):
        """The four sides as (corner, corner, length)."""
        p1, p2, p3, p4 = self._env.task.cloth.corners.tolist()
        width, depth = self._env.task.cloth.size
        return [(p1, p2, depth), (p3, p4, depth), (p1, p3, width), (p2, p4, width)]

    def _episode(self):
        self.log = []
        first = True
        while True:
            score = self._env.task.info()["normalized_performance"]
            left = self._env.horizon - self._env.step_count
            self.log.append((self._env.step_count, round(score, 2)))
            if first or (score < 0.45 and left > 45):
                first = False
                grips = np.zeros(2)
                yield from self._take_side(grips)
                if grips.all():
                    yield from self._drag(grips)
                continue
            places = self._misplaced() if score < 0.97 and left > 12 else []
            if places:
                yield from self._put(places)
                continue
            yield from self._park()
            self.log.append("park")
            while True:
                yield from self._wait((0, 0))

    def _registered(self) -> np.ndarray:
        """The flat cloth (n, 3) laid where most of the cloth is."""
        vertices = self._target.vertices()
        best = None
        for mirror in (1.0, -1.0):
            flat = self._env.task.cloth.flat() * [1.0, mirror, 1.0]
            weights = np.ones(len(flat))
            for _ in range(20):
                w = weights / weights.sum()
                p, q = w @ flat[:, :2], w @ vertices[:, :2]
                u, _, vt = np.linalg.svd((flat[:, :2] - p).T @ (w[:, None] * (vertices[:, :2] - q)))
                rotation = u @ np.diag([1.0, np.linalg.det(u @ vt)]) @ vt
                placed = flat.copy()
                placed[:, :2] = (flat[:, :2] - p) @ rotation + q
                residual = np.linalg.norm(placed - vertices, axis=1)
                weights = 1.0 / (0.02 + residual)
            cost = np.log(0.02 + residual).sum()
            if best is None or cost < best[0]:
                best = cost, placed
        return best[1]

    def _misplaced(self):
        """Up to two exposed vertices far from their places, each with its place."""
        placed, vertices = self._registered(), self._target.vertices()
        offset = placed - vertices
        distance = np.linalg.norm(offset[:, :2], axis=1)
        distance[self._env.task.cloth.corners] *= 1.5
        chosen = []
        for v in np.argsort(-distance)[:120].tolist():
            if distance[v] < 0.04 or len(chosen) == 2:
                break
            apart = all(
                min(
                    np.linalg.norm(vertices[v] - vertices[w]),
                    np.linalg.norm(placed[v] - placed[w]),
                )
                > 0.15
                for w, _ in chosen
            )
            if apart and self._grasp(v)[2] > -0.001:
                goal = placed[v] + 0.02 * offset[v] / np.linalg.norm(offset[v])
                chosen.append((v, goal))
        return chosen

    def _put(self, places):
        """Takes vertices and puts them in their places."""
        grips = np.zeros(2)
        vertices = [v for v, _ in places]
        if len(places) == 2:
            pickers = [0, 1]
            if _crosses(self._actor.positions(), self._target.vertices()[vertices]):
                pickers = [1, 0]
        else:
            pickers = [self._nearest_picker(vertices[0])]
        yield from self._take(pickers, vertices, grips, 1)
        if not grips.any():
            return
        start = self._actor.positions()
        goals = start.copy()
        for i, (v, place) in zip(pickers, places):
            if grips[i]:
                goals[i, :2] = place[:2] - (self._target.vertex(v) - start[i])[:2]
        apex = (start + goals) / 2
        apex[:, 2] = start[:, 2] + np.clip(np.linalg.norm(goals - start, axis=1) / 2, 0.03, 0.2)
        goals[:, 2] = np.where(grips, self._actor.limits[0][2], goals[:, 2])
        apex[grips == 0] = goals[grips == 0]
        yield from self._move(apex, grips, SLOW)
        yield from self._move(goals, grips, SLOW)
        yield from self._wait((0, 0), 1)
        up = self._actor.positions()
        up[:, 2] = TRAVEL_HEIGHT
        yield from self._move(up, (0, 0))

    def _at_corner(self, vertex):
        corner = min(self._env.task.cloth.corners, key=lambda c: self._grid_distance(c, vertex))
        return corner if self._grid_distance(corner, vertex) <= 2 else None

    def _take_side(self, grips):
        """Takes the two ends of a side, one after the other where the cloth has to be lifted."""
        low, high = self._actor.limits
        centre = (low + high) / 2
        cloth = self._env.task.cloth
        corners = cloth.corners.tolist()
        clear = {c: min(self._grasp(c)[2], 0.003) for c in corners}
        sides = self._pairs()
        a, b, length = max(sides, key=lambda p: (min(clear[p[0]], clear[p[1]]), p[2]))
        if min(clear[a], clear[b]) >= 0.0:
            take = [a, b]
            if _crosses(self._actor.positions(), self._target.vertices()[take]):
                take.reverse()
            yield from self._take((0, 1), take, grips)
        for trial in range(5):
            self.log.append((self._env.step_count, self._actor.held.tolist()))
            if grips.all():
                if all(self._at_corner(h) is not None for h in self._actor.held) or trial > 2:
                    return
                # Keep the better one.
                i = 0 if self._at_corner(self._actor.held[0]) is not None else 1
                grips[1 - i] = 0
            if not grips.any():
                corner = self._exposed_near(corners)
                i = self._nearest_picker(corner)
                yield from self._take((i,), (corner,), grips, 1)
                if not grips.any():
                    continue
            i = int(np.argmax(grips))
            goals = self._actor.positions()
            if goals[i, 2] < high[2] - 0.01:
                goals[i] = [*centre[:2], high[2]]
                y = low[1] if goals[1 - i, 1] < centre[1] else high[1]
                goals[1 - i] = [centre[0], y, high[2]]
                yield from self._move(goals, grips)
                yield from self._wait(grips, 1)
            corner = self._at_corner(self._actor.held[i])
            near = corners
            if corner is not None:
                near = [p[1] if p[0] == corner else p[0] for p in sides if corner in p[:2]]
            best = max(near, key=lambda c: min(self._grasp(c)[2], 0.005))
            if self._grasp(best)[2] < 0.0:
                best = self._exposed_near(near)
            yield from self._take((1 - i,), (best,), grips, 1)

    def _exposed_near(self, goals):
        """The exposed vertex with the fewest meshes to one of `goals`."""
        held = self._actor.held
        order = sorted(
            (min(self._grid_distance(g, v) for g in goals), v)
            for v in range(self._target.num_vertices)
            if v not in held
        )
        for _, v in order:
            if self._grasp(v)[2] > 0.0:
                return v
        return order[0][1]

    def _nearest_picker(self, vertex):
        offsets = self._actor.positions() - self._target.vertex(vertex)
        return int(np.argmin(np.linalg.norm(offsets, axis=1)))

    def _park(self):
        goals = self._actor.positions()
        goals[:, 2] = self._actor.limits[1][2]
        yield from self._move(goals, (0, 0))

    def _drag(self, grips):
        low, high = self._actor.limits
        centre = (low + high) / 2
        cloth = self._env.task.cloth
        a, b = self._actor.held
        flat = cloth.flat()
        width = np.linalg.norm(flat[a] - flat[b])
        away = flat - (flat[a] + flat[b]) / 2
        across = (flat[b] - flat[a]) / width
        away -= np.outer(away @ across, across)
        distance = np.linalg.norm(away, axis=1)
        depth = distance.max()
        tail = np.flatnonzero(distance > depth - 0.01)
        offset = self._target.vertices()[[a, b]] - self._actor.positions()
        sign = 1 if self._target.vertex(a)[1] > self._target.vertex(b)[1] else -1
        line = np.array([[0, sign * 0.98 * width / 2, 0], [0, -sign * 0.98 * width / 2, 0]])
        x = lambda: self._target.vertices()[tail, 0].mean() - centre[0]
        side = -1.0 if x() > 0 else 1.0

        def pose(x, z):
            goals = line - offset * [1, 1, 0] + [centre[0] + x, centre[1], 0]
            goals[:, 2] = z
            return goals

        lift = self._actor.positions()
        lift[:, 2] = high[2]
        yield from self._move(lift, grips, LIFT, PASSED)
        self.log.append((self._env.step_count, "lifted"))
        yield from self._move(pose(x(), high[2]), grips, LIFT, 0.02)
        self.log.append((self._env.step_count, "posed"))
        edge = high[0] - centre[0]
        for _ in range(12):
            if edge - side * x() > depth + 0.1:
                break
            now = self._actor.positions()[:, 0].mean() - centre[0]
            if side * now < -edge + 0.02:
                break
            yield self._step(pose(now - side * 0.08, high[2]), grips, LIFT)
        now = self._actor.positions()[:, 0].mean() - centre[0]
        taut = 0
        self.log.append((self._env.step_count, "away"))
        for _ in range(40):
            now += side * PACE
            reach = side * (now - x())
            z = np.sqrt(max(depth**2 - max(reach, 0.0) ** 2, 0.0))
            yield self._step(pose(now, min(z, high[2])), grips, 1.0)
            low_enough = self._actor.positions()[:, 2].max() < low[2] + 0.01
            taut += reach > 0.97 * depth and low_enough
            if taut > 2 or side * now > edge:
                break
        goals = self._actor.positions()
        goals[:, 2] = low[2]
        yield from self._move(goals, grips, SLOW)
        yield from self._wait(grips, 1)
        yield from self._wait((0, 0), 1)
        yield from self._park()


EXPERTS: dict[str, type[Expert]] = {"straighten_rope": StraightenRope, "spread_cloth": SpreadCloth}


def make_policy(env: Environment) -> Callable[[dm_env.TimeStep], np.ndarray]:
    """The expert for an environment.

    Raises:
        UnknownNameError: if its task has none.
    """
    check_name("task", env.name, EXPERTS)
    return EXPERTS[env.name](env)
