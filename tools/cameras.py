"""Frames the cameras of the tasks: for a direction, the smallest pyramid around what is seen.

    python -m tools.cameras --jobs 2                # all; some minutes
    python -m tools.cameras fold_cloth drop_cloth   # these views

writes softgym_mj/entities/views.py. What has to be in the picture is the object, with the cups, the
marks of the goal, pickers from which the object hangs and the hands of arms: at the resets of many
variations of `train`, and along some episodes of the scripted experts. Of all directions that one
is taken from which the object is largest in the picture: worst share of it at a reset times median
along the episodes.
"""

import argparse
import itertools
import math
import os
import pathlib
import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from softgym_mj.entities import views
from softgym_mj.envs.environment import Environment
from softgym_mj.fluid import Water
from softgym_mj.parallel.executors import make_executor
from softgym_mj.registry import TASKS
from softgym_mj.rendering.offscreen import refresh_poses
from softgym_mj.robots.arm.actor import ArmActor
from softgym_mj.robots.arm.menagerie import SHOWN_GROUPS
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.gripper import Gripper
from softgym_mj.variations.indices import SPLITS
from tools.framing import loaded, played
from tools.outlines import cup_corners, geom_corners, hand_corners, mark_corners, surface
from tools.silhouettes import boxes, covered, sampled

FILE = pathlib.Path(views.__file__)
RESETS, EPISODES = SPLITS["train"][::4], SPLITS["train"][5::50]
EVERY = 5  # Env steps of an episode of which one is looked at.
AZIMUTHS, ELEVATIONS = range(-180, 180, 15), range(30, 86, 5)  # [deg] Where the camera is.
ANGLES = (45.0, 30.0)  # [deg] Fields of view.
MARGIN = 0.06  # Free margin, as a share of half the image.
SPLASHED = 0.005  # Share of the particles that may be anywhere.
STRAYED = 0.03  # Share of the experts' frames with parts outside of the image.
DIGITS = 3  # Decimal places of the poses.
# Side of pictures [pixels], resets and frames of episodes, of a first and of a second comparison.
COARSE, FINE = (48, 10), (64, 40)
SAMPLES, FEWER = 3000, 200  # Points on the object, and on a part of the actor.
CHOSEN = 10  # Directions of the second one.
Row = tuple[tuple[float, ...], tuple[float, ...], float]  # As in `views.FRAMED`.


class Direction(NamedTuple):
    """From where a camera looks, and how much it sees.

    Attributes:
        axes: (3, 3), rows: right, up and backward.
        angle: field of view [deg].
    """

    axes: np.ndarray
    angle: float

    @property
    def free(self) -> float:
        """Tangent of half the angle in which everything has to be."""
        return (1.0 - MARGIN) * math.tan(math.radians(self.angle) / 2)

    @property
    def normals(self) -> np.ndarray:
        """(4, 3), outward, of the pyramid's right, left, upper and lower side; not of length 1."""
        right, up, back = self.axes
        edge = self.free * back
        return np.array([right + edge, edge - right, up + edge, edge - up])

    def pose(self, reaches: np.ndarray) -> Row:
        """The nearest camera that sees everything as far along the `normals` as this (4,) [m]."""
        right, left, top, bottom = reaches
        away = max(right + left, top + bottom) / (2.0 * self.free)
        place = np.array([(right - left) / 2.0, (top - bottom) / 2.0, away]) @ self.axes
        back = self.axes[2]
        floor = place - place[2] / back[2] * back
        position, middle = (tuple(np.round(p, DIGITS).tolist()) for p in (place, floor))
        return position, middle, self.angle


def directions(steep: bool) -> list[Direction]:
    """All that are compared; straight down, too, if `steep`."""
    found = []
    for azimuth, elevation in itertools.product(np.radians(AZIMUTHS), np.radians(ELEVATIONS)):
        flat = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
        back = math.cos(elevation) * flat + [0.0, 0.0, math.sin(elevation)]
        right = np.array([-flat[1], flat[0], 0.0])
        found.append(np.array([right, np.cross(back, right), back]))
    found += [np.eye(3)] if steep else []
    return [Direction(axes, angle) for axes in found for angle in ANGLES]


def contents(env: Environment, hangs: bool) -> Iterator[tuple[np.ndarray, float, int]]:
    """Points (n, 3) [m] of what has to be seen now, their radius, how many need not be seen."""
    scene, actor = env.task.scene, env.task.actor
    for thing in scene.materials.values():
        points = thing.points()
        if isinstance(thing, Water):  # What is in a cup is seen with the cup.
            spilled = ~np.any([cup.inside(points) for cup in scene.cups], axis=0)
            yield points[spilled], thing.spacing / 2, int(SPLASHED * len(points))
        else:
            yield points, thing.radius, 0
    for cup in scene.cups:
        yield cup_corners(cup), 0.0, 0
    if len(marks := mark_corners(env)):
        yield marks, 0.0, 0
    if isinstance(actor, ArmActor):
        yield hand_corners(env).reshape(-1, 3), 0.0, 0
    elif hangs:
        yield actor.positions(), actor.radius, 0


def reaches(env: Environment, hangs: bool, normals: np.ndarray) -> np.ndarray:
    """Extent (n,) [m] of everything to be shown now along normals (n, 3)."""
    found = []
    for points, radius, spare in contents(env, hangs):
        if len(points) > spare:
            last = len(points) - 1 - spare
            far = np.partition(points @ normals.T, last, axis=0)[last]
            found.append(far + radius * np.linalg.norm(normals, axis=1))
    return np.max(found, axis=0)


class Frame(NamedTuple):
    """Objects that a camera has to show.

    Attributes:
        starts: whether it is the start of an episode.
        reaches: as the function's.
        seen: points (n, 3) [m] on the object and the cups.
        others: points (m, k, 3) [m] on what may hide it: parts of the actor.
        size: area of the object's box in top view [m^2].
    """

    starts: bool
    reaches: np.ndarray
    seen: np.ndarray
    others: np.ndarray
    size: float


def frames(env: Environment, normals: np.ndarray) -> Iterator[Frame]:
    """Starts, then what happens in episodes of the expert."""
    env.reset(RESETS[0])
    actor = env.task.actor
    hangs = isinstance(actor, Gripper) and max(actor.held) >= 0

    def frame(starts: bool) -> Frame:
        refresh_poses(env.physics)
        model = env.physics.model.ptr
        owners = [model.body(body).name.split("/") for body in model.geom_bodyid]
        own = [
            i for i, owner in enumerate(owners)
            if owner[0] in actor.model_names and "cup" not in owner
            and model.geom_group[i] < SHOWN_GROUPS
        ]  # fmt: skip
        size = np.prod(np.ptp(env.task.points()[:, :2], axis=0))
        far = reaches(env, hangs, normals)
        others = [sampled(boxes(each[None]), FEWER) for each in geom_corners(env, own)]
        others = np.array(others).reshape(-1, FEWER, 3)
        return Frame(starts, far, sampled(surface(env), SAMPLES), others, size)

    for variation in RESETS:
        env.reset(variation)
        yield frame(True)
    for variation in EPISODES:
        for step in played(env, variation):
            if step % EVERY == 0:
                yield frame(False)


def share(frame: Frame, direction: Direction, row: Row, side: int) -> float:
    """Share of the picture that shows the object: what is nearer than its middle hides it."""
    place, axes = np.array(row[0]), direction.axes
    half = math.tan(math.radians(direction.angle) / 2)
    nearer = frame.others.mean(axis=1) @ axes[2] > frame.seen.mean(axis=0) @ axes[2]
    parts = frame.seen, frame.others[nearer].reshape(-1, 3)
    seen, hidden = (covered(part, place, axes, half, side) for part in parts)
    return float((seen & ~hidden).mean())


def scores(
    every: Sequence[Frame], compared: Sequence[tuple[Direction, Row]], how: tuple[int, int]
) -> np.ndarray:
    """Score of each camera (n,): worst share at the smallest starts times median along episodes."""
    side, number = how
    starts = sorted((f for f in every if f.starts), key=lambda frame: frame.size)[:number]
    others = [f for f in every if not f.starts]
    others = [others[i] for i in np.linspace(0, len(others) - 1, number).astype(int)]
    return np.array(
        [
            min(share(frame, *camera, side) for frame in starts)
            * np.median([share(frame, *camera, side) for frame in others])
            for camera in compared
        ]
    )


def found(view: str, tasks: Sequence[str], actors: Sequence[str]) -> tuple[Row, float]:
    """The best camera of tasks that have the same view, with some actors, and its score."""
    compared = directions("rope" in view)
    normals = np.concatenate([direction.normals for direction in compared])
    every = [
        frame
        for task in tasks
        for actor in actors
        for frame in frames(loaded(task, actor), normals)
    ]
    reach = np.maximum(
        np.max([frame.reaches for frame in every if frame.starts], axis=0),
        np.quantile([f.reaches for f in every if not f.starts], 1.0 - STRAYED / 4, axis=0),
    ).reshape(-1, 4)
    cameras = [(d, d.pose(far)) for d, far in zip(compared, reach, strict=True)]
    first = scores(every, cameras[:: len(ANGLES)], COARSE)
    best = np.argsort(-first)[:CHOSEN] * len(ANGLES)
    cameras = [cameras[i + angle] for i in best for angle in range(len(ANGLES))]
    second = scores(every, cameras, FINE)
    return cameras[int(np.argmax(second))][1], float(second.max())


def written(framed: dict[str, list[Row]]) -> str:
    """The lines of `views.FRAMED`."""
    lines = ["FRAMED = {"]
    for view, rows in sorted(framed.items()):
        lines += [f'    "{view}": (', *(f"        {row}," for row in rows), "    ),"]
    return "\n".join([*lines, "}"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("views", nargs="*", help="all if none is named")
    parser.add_argument("--jobs", type=int, default=1)
    arguments = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    tasks: dict[str, list[str]] = {}
    for name, record in TASKS.items():
        tasks.setdefault(record.resolve().view, []).append(name)
    chosen = arguments.views or list(tasks)
    groups = ("default",), tuple(ARMS)
    calls = [(view, tasks[view], actors) for actors in groups for view in chosen]
    framed = {view: list(rows) for view, rows in views.FRAMED.items()}
    with make_executor(arguments.jobs) as executor:
        for index, (row, score) in executor.results(found, calls):
            view, _, actors = calls[index]
            framed[view][groups.index(actors)] = row
            print(view, actors, row, f"{score:.2e}", flush=True)
            text = re.sub(r"FRAMED = \{[\s\S]*?\n\}", written(framed), FILE.read_text(), count=1)
            FILE.write_text(text)


if __name__ == "__main__":
    main()
