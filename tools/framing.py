"""Visibility of objects in the task's cameras, on variations `tools/cameras.py` did not frame.

What is measured is rendered with a wider field of view: the middle of the image is the picture.
"""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

import softgym_mj
from softgym_mj.envs.environment import Environment
from softgym_mj.policies.factory import make_policy
from softgym_mj.rendering.observables import LABELS, LabeledView
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.variations.indices import SPLITS

ACTORS = ("default", *ARMS)  # Pickers or cups, arms.
RESETS = SPLITS["evaluate"][::5]
EPISODES = SPLITS["evaluate"][10::50]
SIDE, SMALL = 128, 64  # [pixels] Side of images of resets, and of those along episodes.
WIDER = 1.5  # Times as far to all sides.
EVERY = 4  # Env steps of an episode of which one is looked at.
WHOLE = (
    0.99  # Share of the object's pixels inside the image, from which it counts as wholly inside.
)
SEEN = [LABELS.index(label) for label in ("object", "container")]


class Shown(NamedTuple):
    """Visibility of the object in an image, cups included.

    Attributes:
        share: of the picture that shows it.
        inside: share of its pixels that are in the picture; 0 if there are none at all.
    """

    share: float
    inside: float


class Eye:
    """Looks through the task's camera, and beside what it shows."""

    def __init__(self, env: Environment, side: int = SIDE, wider: float = WIDER):
        """Binds the environment; `side` is that of the picture [pixels]."""
        self._env, self._side, self._wider = env, side, wider
        whole, scene = round(wider * side), env.task.scene
        self._camera = LabeledView("task", whole, whole, lambda: scene.segmentation_models)

    def look(self) -> Shown:
        """Measures the current image."""
        model = self._env.physics.model.ptr
        camera = model.camera("task").id
        angle = model.cam_fovy[camera]
        half = self._wider * math.tan(math.radians(angle) / 2)
        model.cam_fovy[camera] = 2 * math.degrees(math.atan(half))
        seen = np.isin(self._camera.labels(self._env.physics), SEEN)
        model.cam_fovy[camera] = angle
        edge = (len(seen) - self._side) // 2
        picture = seen[edge : edge + self._side, edge : edge + self._side]
        return Shown(float(picture.mean()), float(picture.sum() / max(seen.sum(), 1)))


def loaded(task: str, actor: str) -> Environment:
    """The environment of a task with one of `ACTORS`."""
    own = {} if actor == "default" else {"actor": actor}
    return softgym_mj.load(task, split="all", **own)


def played(env: Environment, variation: int) -> Iterator[int]:
    """Plays an episode of the scripted expert; yields the number of env steps made, from 0 on."""
    for _ in env.play(make_policy("scripted", env), variation):
        yield env.step_count


def at_resets(env: Environment, variations: Iterable[int]) -> list[Shown]:
    """Measures the starts of variations."""
    eye, found = Eye(env), []
    for variation in variations:
        env.reset(variation)
        found.append(eye.look())
    return found


def along(env: Environment, variations: Iterable[int]) -> list[Shown]:
    """Measures the expert's episodes, every `EVERY` env steps from the start on."""
    eye = Eye(env, SMALL)
    steps = (step for variation in variations for step in played(env, variation))
    return [eye.look() for step in steps if step % EVERY == 0]
