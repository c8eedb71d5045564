"""Observations as data: names, and the functions that compute those that follow from the state."""

import collections
import math
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from array_api_compat import device
from dm_control.composer.observation import observable

from softgym_mj.exceptions import InvalidArgumentError, check_image_size, check_name
from softgym_mj.metrics import Array, namespace
from softgym_mj.rendering.observables import (
    EXTERNAL_RGB,
    WRIST_RGB,
    CameraObservable,
    fixed_observables,
)
from softgym_mj.rendering.offscreen import LARGEST_IMAGE
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.gripper import HELD
from softgym_mj.tasks.shared.entries import values
from softgym_mj.tasks.shared.state import Episode, State

Value = Callable[[Any, State, Episode], Array]  # Arguments: task, state, episode.


class StateObservation(NamedTuple):
    """Observation that follows from the state, of one simulation or of a batch.

    Attributes:
        value: returns (..., n) for a task, a state and its episode.
        summary: description.
    """

    value: Value
    summary: str


def full(task: Any, state: State, episode: Episode) -> Array:
    """Returns all points (x, y, z each), zero padding, `extra_state`, proprioception: (..., n)."""
    lead = state.sensed.shape[:-1]
    points = _joined(state.points.values(), lead)
    missing = 3 * task.max_points - points.shape[-1]
    padding = namespace(points).zeros((*lead, missing), device=device(points))
    extra = values("extra_state", task.extra_state(state, episode))
    return _joined([points, padding, *extra, *_sensed(task, state)], lead)


def full_mask(task: Any, state: State, episode: Episode) -> Array:
    """Returns 1 for each existing point of `full`, else 0: (..., max_points) uint8."""
    lead = state.sensed.shape[:-1]
    present = _joined(state.present.values(), lead)
    xp = namespace(present)
    missing = task.max_points - present.shape[-1]
    whole = xp.concat(
        [present, xp.zeros((*lead, missing), dtype=present.dtype, device=device(present))], axis=-1
    )
    return xp.astype(whole, xp.uint8)


def reduced(task: Any, state: State, episode: Episode) -> Array:
    """Returns the numbers of `Task.reduced`, then the actor's proprioception: (..., n)."""
    return _listed("reduced", task, state, episode)


def key_points(task: Any, state: State, episode: Episode) -> Array:
    """Returns the numbers of `Task.key_points`, then the actor's proprioception: (..., n)."""
    return _listed("key_points", task, state, episode)


def markov(task: Any, state: State, episode: Episode) -> Array:
    """Returns `reduced`, then what else determines the actor's next steps: (..., n)."""
    seen = reduced(task, state, episode)
    return namespace(seen).concat([seen, state.remembered], axis=-1)


def _listed(method: str, task: Any, state: State, episode: Episode) -> Array:
    """Returns the numbers that a method of the task lists, then proprioception: (..., n)."""
    entries = values(method, getattr(task, method)(state, episode))
    return _joined([*entries, *_sensed(task, state)], state.sensed.shape[:-1])


def _sensed(task: Any, state: State) -> list[Array]:
    return [state.sensed] if task.actor.ends_states else []


def _joined(arrays: Iterable[Array], lead: tuple[int, ...]) -> Array:
    """Returns all numbers of some arrays as one array (..., n)."""
    parts = [array.reshape((*lead, math.prod(array.shape[len(lead) :]))) for array in arrays]
    return namespace(parts[0]).concat(parts, axis=-1)


# Positions are in meters, in the world frame.
STATES = {
    "full": StateObservation(
        full, "every point (zero-padded to the largest variation), then the grippers or cups"
    ),
    "reduced": StateObservation(
        reduced, "key points, sizes and the actor's position, listed on the task's data sheet"
    ),
    "markov": StateObservation(
        markov,
        "`reduced`, then the actor's internal state: grips and positions of held vertices, the "
        "velocity of a cup, commands of arms",
    ),
    "key_points": StateObservation(
        key_points,
        "`reduced`, with 8 x 8 vertices of a rectangular cloth in place of its corners; the same "
        "as `reduced` for others",
    ),
    "full_mask": StateObservation(
        full_mask, "uint8, 1 for each point of `full` that exists and 0 for padding"
    ),
    "proprioception": StateObservation(
        lambda task, state, episode: state.sensed,
        "the actor's own state: positions of pickers, the pose of a cup, or tool points, "
        "openings and joints of arms",
    ),
}
# Descriptions by name.
OBSERVATIONS = {
    **{name: seen.summary for name, seen in STATES.items()},
    "rgb": "uint8 image (height, width, 3) from the task camera",
    "depth": "float32 image (height, width) of distances along the view direction [m]",
    "segmentation": "uint8 image (height, width) of labels: 0 background, 1 object (also "
    "behind glass), 2 actor, 3 container",
    "external_rgb": "uint8 images (2, height, width, 3) from the cameras on the left and right",
    "external_depth": "float32 images (2, height, width) from these cameras, as `depth` [m]",
    "point_cloud": "float32 (1024, 4): x, y, z of evenly spread points of the object visible to "
    "these cameras, and 1; rows of zeros if fewer are visible",
}
TAKEN = ("rgb", EXTERNAL_RGB, WRIST_RGB)  # Images to which the sensor parameters of a domain apply.
GOAL_RGB = "goal_rgb"  # "rgb" with the goal reached, for tasks that can render it.
# Requirements of the observations that some actors or tasks lack.
_NEEDS = {
    WRIST_RGB: f"an arm: actor={', '.join(map(repr, ARMS))}",
    HELD: "grippers, which tasks with cloth or rope have",
    GOAL_RGB: "a task that renders its goal, such as rope_configuration",
}
# These show the goal without marks in images.
_SHOW_GOAL = {"full", "reduced", "markov", "key_points", GOAL_RGB}
DEFAULT_IMAGE_SIZE = (128, 128)  # (height, width), as in the paper's experiments.


def names_of(observation: str | Sequence[str]) -> tuple[str, ...]:
    """Returns the names of one or several observations."""
    return (observation,) if isinstance(observation, str) else tuple(observation)


def enabled_names(observation: str | Sequence[str], available: Iterable[str]) -> tuple[str, ...]:
    """Returns the observation names that a setting selects.

    Args:
        observation: one name, or a sequence of distinct names.
        available: names of the task's observations.

    Raises:
        InvalidArgumentError: for an unknown name, none or a duplicate.
    """
    available = tuple(available)
    if not isinstance(observation, Sequence):
        raise InvalidArgumentError("observation", observation, available)
    names = names_of(observation)
    for name in sorted(_NEEDS.keys() & {*names} - {*available}):
        raise InvalidArgumentError(f"observation={observation!r}: {name!r} needs {_NEEDS[name]}")
    for name in names:
        check_name("observation", name, available)
    if not names or len(set(names)) != len(names):
        valid = f"one or more different names of {', '.join(map(repr, available))}"
        raise InvalidArgumentError("observation", observation, valid)
    return names


def make_observables(
    task: Any,
    observation: str | Sequence[str],
    image_size: tuple[int, int],
    goal_marks: bool = False,
) -> "collections.OrderedDict[str, observable.Observable]":
    """Returns all observables of a task by name, with those of a setting enabled.

    Args:
        task: task with its scene and actor.
        observation: as in `enabled_names`.
        image_size: (height, width) of images [pixels].
        goal_marks: whether colored images show the marks of the task's goal.
    """
    height, width = check_image_size("image_size", image_size, LARGEST_IMAGE)
    states = {
        name: observable.Generic(lambda physics, name=name: task.observe(name)) for name in STATES
    }
    found = collections.OrderedDict(
        **states,
        **fixed_observables(height, width, lambda: task.scene.segmentation_models),
        **task.actor.own_observables(height, width),
        **task.own_observables(height, width),
    )
    for name in found.keys() & TAKEN:
        found[name].corruptor = lambda images, random_state, name=name: task.scene.seen(
            name, images, task.variation
        )
        if isinstance(found[name], CameraObservable):
            for view in found[name].views:
                view.marks = goal_marks
    for name in enabled_names(observation, found):
        found[name].enabled = True
    return found


def shows_goal(names: Iterable[str], goal_marks: bool) -> bool:
    """Returns whether one of several observations shows a goal that depends on the variation.

    Args:
        names: names of observations.
        goal_marks: whether colored images show the marks of the goal.
    """
    return not {*names}.isdisjoint(_SHOW_GOAL | {*(TAKEN if goal_marks else ())})


def warn_of_hidden_goal(observables: Mapping[str, observable.Observable], goal_marks: bool) -> None:
    """Warns if no enabled observation shows a goal that depends on the variation.

    Args:
        observables: by name, as `make_observables` returns them.
        goal_marks: whether colored images show the marks of the goal.
    """
    enabled = {name for name, seen in observables.items() if seen.enabled}
    if shows_goal(enabled, goal_marks):
        return
    others = sorted(_SHOW_GOAL & set(observables))
    warnings.warn(
        f"observation={sorted(enabled)} does not show the goal, which depends on the variation: "
        f"observe 'rgb' with goal_marks=True (the default), or one of {others}, too",
        stacklevel=3,
    )
