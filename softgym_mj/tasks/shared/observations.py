"""Observation presets as data."""

from collections.abc import Iterable, Sequence

from softgym_mj.exceptions import InvalidArgumentError

# name: what it is. Positions are in metres, in the world frame.
OBSERVATIONS = {
    "full": "every point (zero-padded to the largest variation), then the grippers or cups",
    "full_mask": "uint8, 1 for each point of `full` that exists and 0 for padding",
    "reduced": "the few numbers that describe the state, listed in the task's docstring",
    "proprioception": "what the actor senses of itself: positions of pickers, the pose of a cup "
    "or tool points, openings and joints of arms",
    "rgb": "uint8 image (height, width, 3) from the task camera",
    "depth": "float32 image (height, width) of distances along the view direction [m]",
    "segmentation": "uint8 image (height, width) of what is seen: 0 background, 1 object, 2 actor, "
    "3 container, 4 goal",
    "point_cloud": "float32 (1024, 4): x, y, z of points of the object that the camera sees, and "
    "1; rows of zeros where it sees fewer",
}
GOAL_RGB = "goal_rgb"  # The same image with the goal reached, where a task can show it.
DEFAULT_IMAGE_SIZE = (128, 128)  # (height, width), as in the paper's experiments.


def enabled_names(
    observation: str | Sequence[str], available: Iterable[str] = OBSERVATIONS
) -> tuple[str, ...]:
    """The observation names that a setting asks for.

    Args:
        observation: one name, or a sequence of distinct names.
        available: names of the task's observations.

    Raises:
        InvalidArgumentError: for a name that does not exist, none or one given twice.
    """
    available = tuple(available)
    names = (observation,) if isinstance(observation, str) else observation
    if not isinstance(names, Sequence):
        raise InvalidArgumentError("observation", observation, available)
    names = tuple(names)
    if not names or len(set(names)) != len(names) or not set(names) <= set(available):
        raise InvalidArgumentError("observation", observation, available)
    return names
