"""Does a score depend on the resolution? Episodes with other meshes and with smaller steps.

Actions are recorded at the default resolution, then replayed, open loop, with fewer and with more
vertices or particles (fidelities "fast" and "accurate"), with half the physics step, and as they
were but for noise of a thousandth of the fastest action. They are the scripted expert's up to the
first release; a crumpled cloth is taken at two points, lifted, pulled apart and dragged. What an
expert does beyond that cannot be replayed: whether the next grasp on a crumpled cloth or a twisted
rope finds its vertex is a matter of chance, with that noise as well as with another resolution. So
the expert itself plays the other episodes, too, closed loop.

All start alike: other cloths and ropes as the default one, interpolated; other water rests in the
same cup. The interpolated layers of a crumpled cloth are too close to each other and push the pile
apart by some centimeters, so that the same actions would miss it: there the script is played anew.

    python benchmarks/resolution.py --out benchmarks/resolution.json
"""

import argparse
import collections
import json
import os
import pathlib
import tempfile

import numpy as np

import softgym_mj
from softgym_mj import registry
from softgym_mj.entities.cloth import grid_shape
from softgym_mj.envs.environment import Environment
from softgym_mj.policies.experts import make_policy
from softgym_mj.policies.experts.cloth_expert import TRAVEL_HEIGHT, ClothExpert
from softgym_mj.policies.experts.picker_expert import CLEAR, OPEN, SLOW
from softgym_mj.variations.store import CACHE_VARIABLE

VARIATIONS = range(800, 810)
MESHES = {"coarser": "fast", "finer": "accurate"}
NOISE = 1e-3  # Standard deviation of the noise of actions in [-1, 1].
CRUMPLED = ("spread_cloth", "fold_crumpled_cloth")
HUNG, LAID = 0.45, 0.03  # [m] Heights of the pickers.
SETTLE_STEPS = 25  # Env steps: 2 s.
WAY = 0.3  # [m] From the middle of the workspace to where dragging starts and ends.
WIDEST = 0.6  # [m] Distance to which the two points are pulled apart.


def build(task: str, substeps: int = 1, **settings) -> Environment:
    """An environment whose physics step is the usual one divided by `substeps`."""
    record = registry.TASKS[task]
    built = record.build(**settings)
    built.set_timesteps(built.control_timestep, built.physics_timestep / substeps)
    return Environment(built, name=task, horizon=record.horizon, split="evaluate")


def resampled_line(points: np.ndarray, count: int) -> np.ndarray:
    """The vertices (n, 3) of a rope as `count` ones on the same line."""
    places = np.linspace(0.0, len(points) - 1, count)
    return np.column_stack([np.interp(places, np.arange(len(points)), x) for x in points.T])


def resampled_sheet(
    points: np.ndarray, shape: tuple[int, int], other: tuple[int, int]
) -> np.ndarray:
    """The vertices (n, 3) of a cloth of (rows, columns) as another grid on the same triangles."""
    grid = points.reshape(*shape, 3)
    (row, t), (column, s) = (
        np.modf(np.minimum(np.linspace(0.0, n - 1, m), n - 1 - 1e-9))[::-1]
        for n, m in zip(shape, other, strict=True)
    )
    row, column = (index.astype(int) for index in np.meshgrid(row, column, indexing="ij"))
    t, s = (part[..., None] for part in np.meshgrid(t, s, indexing="ij"))
    a, b = grid[row, column], grid[row, column + 1]
    c, d = grid[row + 1, column], grid[row + 1, column + 1]
    # The diagonals of `Cloth.triangles` alternate: from b to c, else from a to d.
    falling = np.where(
        s + t <= 1.0, a + s * (b - a) + t * (c - a), d + (1 - s) * (c - d) + (1 - t) * (b - d)
    )
    rising = np.where(t >= s, a + t * (c - a) + s * (d - c), a + s * (b - a) + t * (d - b))
    return np.where((row + column)[..., None] % 2 == 0, falling, rising).reshape(-1, 3)


def share_states(usual: Environment, other: Environment, kind: str, fidelity: str) -> None:
    """Stores the initial states of `usual` as those of `other`, of another fidelity."""
    for index in VARIATIONS:
        points = usual.task.store.load(index)
        if kind == "rope":
            points = resampled_line(points, other.task.rope.num_points)
        else:
            usual.task.choose_variation(index)
            shapes = [grid_shape(usual.task.cloth.dims, name) for name in ("default", fidelity)]
            points = resampled_sheet(points, *shapes)
        other.task.store.put(index, points)
        if usual.name in CRUMPLED:  # Interpolated layers are too close to each other in places.
            other.reset(index)
            for _ in range(SETTLE_STEPS):
                other.step(np.tile([0.0, 0.0, 0.0, -1.0], 2))
            other.task.store.put(index, other.task.points())


def play(env: Environment, variation: int, policy) -> tuple[float, np.ndarray]:
    """The normalized performance at the end and the actions (T, n) of an episode."""
    timestep, actions = env.reset(variation), []
    while not timestep.last():
        actions.append(policy(timestep))
        timestep = env.step(actions[-1])
    return env.info()["normalized_performance"], np.array(actions)


class LiftAndDrag(ClothExpert):
    """Takes two points of a crumpled cloth, lifts it, pulls them apart and drags it along X."""

    margin = 0.006  # Nearer than the experts': whether a vertex is taken must not hang by a hair.

    def _episode(self):
        grips = [False, False]
        yield from self._take(dict(enumerate(self._matched(self._far_apart()))), grips)
        a, b = self._actor.held
        flat, (low, high) = self._env.task.cloth.flat(), self._actor.limits
        yield from self._move(self._raised(HUNG), grips, SLOW)
        goals = np.tile((low + high) / 2, (2, 1))
        side = np.sign(self._target.vertex(a)[1] - self._target.vertex(b)[1])
        width = min(np.linalg.norm(flat[a] - flat[b]), WIDEST)
        goals[:, 1] += np.array([side, -side]) * width / 2
        for x, z in ((-WAY, HUNG), (WAY, LAID)):
            goals[:, 0], goals[:, 2] = (low + high)[0] / 2 + x, z
            yield from self._move(goals, grips, SLOW)
        yield from self._move(self._raised(TRAVEL_HEIGHT), OPEN)
        while True:
            yield self._rest(OPEN)

    def _far_apart(self) -> list[int]:
        """The two well exposed vertices that are the furthest from each other."""
        vertices = self._target.points()
        free = [v for v in range(len(vertices)) if self._grasp(v)[2] >= CLEAR]
        distance = np.linalg.norm(vertices[free][:, None] - vertices[free], axis=2)
        return [free[i] for i in np.unravel_index(np.argmax(distance), distance.shape)]


def until_release(actions: np.ndarray) -> np.ndarray:
    """Actions (T, 4 n) of grippers that stay where they are, open, after the first release."""
    closed = actions[:, 3::4] > 0.0
    released = np.any(closed[:-1] & ~closed[1:], axis=1)
    if not released.any():
        return actions
    actions = actions.copy()
    rest = np.tile([0.0, 0.0, 0.0, -1.0], actions.shape[1] // 4)
    actions[np.argmax(released) + 1 :] = rest
    return actions


def measure(task: str, closed_loop: bool) -> dict[str, list[float]]:
    """Scores of one task by setting, one for each variation; with the expert's if `closed_loop`."""
    kind = registry.TASKS[task].tags[-1]
    usual = build(task)
    others = {name: build(task, fidelity=fidelity) for name, fidelity in MESHES.items()}
    if kind != "water":
        for name, fidelity in MESHES.items():
            share_states(usual, others[name], kind, fidelity)
    others["half step"] = build(task, substeps=2)
    scores: dict[str, list[float]] = collections.defaultdict(list)
    random = np.random.default_rng(0)
    for variation in VARIATIONS:
        score, actions = play(usual, variation, make_policy(usual))
        scores["expert"].append(score)
        if task in CRUMPLED:
            actions = play(usual, variation, LiftAndDrag(usual))[1]
        elif kind != "water":
            actions = until_release(actions)
        scores["replay"].append(play(usual, variation, _replay(actions))[0])
        noisy = actions + random.uniform(-NOISE, NOISE, actions.shape)
        scores["replay, noise"].append(play(usual, variation, _replay(noisy.clip(-1.0, 1.0)))[0])
        for name, env in others.items():
            anew = task in CRUMPLED and name in MESHES
            script = LiftAndDrag(env) if anew else _replay(actions)
            scores[f"replay, {name}"].append(play(env, variation, script)[0])
            if closed_loop:
                scores[f"expert, {name}"].append(play(env, variation, make_policy(env))[0])
        print(task, variation, *(f"{name} {values[-1]:.3f}" for name, values in scores.items()),
              sep="; ", flush=True)  # fmt: skip
    return scores


def _replay(actions: np.ndarray):
    """A policy that repeats actions."""
    rest = iter(actions)
    return lambda timestep: next(rest)


def report(results: dict[str, dict[str, list[float]]]) -> None:
    """Prints a table of means: of a replay and the expert, and by how much the others differ."""
    names = ("noise", *MESHES, "half step")
    print(f"| task | replay | {' | '.join(names)} | expert | {' | '.join(names[1:])} |")
    print("|---" * 10 + "|")
    for task, scores in results.items():
        cells = []
        for played in ("replay", "expert"):
            mean = float(np.mean(scores[played]))
            others = [scores.get(f"{played}, {name}") for name in names]
            cells += [f"{mean:.3f}", *(f"{np.mean(o) - mean:+.3f}" for o in others if o)]
        print(f"| {task} | {' | '.join(cells)} |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tasks", nargs="*", help="all if none is named")
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--replay", action="store_true", help="only the replays")
    arguments = parser.parse_args()
    results = {}
    # Interpolated states must not get into the user's cache.
    with tempfile.TemporaryDirectory() as cache:
        os.environ[CACHE_VARIABLE] = cache
        for task in arguments.tasks or softgym_mj.TASKS:
            results[task] = measure(task, not arguments.replay)
            if arguments.out:
                arguments.out.write_text(json.dumps(results, indent=2))
    report(results)


if __name__ == "__main__":
    main()
