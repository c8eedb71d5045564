"""Conversion of SoftGym's axes and action modes to this package's."""

import contextlib
from collections.abc import Callable
from typing import Any, NamedTuple

import gymnasium
import numpy as np

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.robots.workspace import Workspace
from softgym_mj.validation import as_array


def to_flex(vectors: np.ndarray) -> np.ndarray:
    """Converts vectors (..., 3) to SoftGym's axes: x, y = up, z."""
    return np.stack([vectors[..., 0], vectors[..., 2], -vectors[..., 1]], axis=-1)


def from_flex(vectors: np.ndarray) -> np.ndarray:
    """Converts vectors (..., 3) from SoftGym's axes to X, Y, Z = up."""
    return np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], axis=-1)


def checked(action: object, space: gymnasium.spaces.Box) -> np.ndarray:
    """Returns an action (n,) as floats.

    Raises:
        InvalidArgumentError: for a wrong shape, NaN or other numbers than those of the space.
    """
    array = as_array("action", action)
    if array.dtype.kind in "fiub" and array.shape != space.shape:
        raise InvalidArgumentError("action.shape", array.shape, f"{space.shape}, finite numbers")
    with contextlib.suppress(TypeError, ValueError):
        array = array.astype(float)
        if space.contains(array.astype(np.float32)):
            return array
    valid = f"finite numbers from {space.low.tolist()} to {space.high.tolist()}"
    raise InvalidArgumentError("action", action, valid)


def _moved(actor: Any, action: np.ndarray, part: np.ndarray) -> np.ndarray:
    each = part.reshape(-1, 4)
    return np.column_stack([from_flex(each[:, :3]), each[:, 3]]).ravel()


def _placed(actor: Any, action: np.ndarray, part: np.ndarray) -> np.ndarray:
    low, high = actor.limits
    goals = np.clip(from_flex(action.reshape(-1, 4)[:, :3]), low, high)
    fractions = 2.0 * (goals - low) / (high - low) - 1.0
    return np.column_stack([fractions, part.reshape(-1, 4)[:, 3]]).ravel()


class ActionMode(NamedTuple):
    """Action mode of SoftGym.

    Attributes:
        actor: Name of the actor.
        low, high: SoftGym's box of each picker or of the cup (docs/softgym.md 2.1, 2.5, 3.1, 3.2).
        ours: Maps an actor, SoftGym's action, and that as fractions of the box to our action.
        workspace: Workspace of the actor in our axes [m] (docs/softgym.md 2.2); None: the task's.
    """

    actor: str
    low: tuple[float, ...]
    high: tuple[float, ...]
    ours: Callable[[Any, np.ndarray, np.ndarray], np.ndarray]
    workspace: Workspace | None = None


_PPP = Workspace((-0.5, -0.5, 0.0), (0.5, 0.5, 0.3))
_QPG = Workspace((-0.3, -0.3, 0.0), (0.3, 0.3, 0.3))
ACTION_MODES = {
    "picker": ActionMode("picker", (-0.01, -0.01, -0.01, 0), (0.01, 0.01, 0.01, 1), _moved),
    "pickerpickplace": ActionMode(
        "pick_and_place", (-0.5, 0, -0.5, 0), (0.5, 0.3, 0.5, 1), _placed, _PPP
    ),
    "picker_qpg": ActionMode(
        "pixel_pick_and_place", (-1, -1, -0.3, 0, -0.3), (1, 1, 0.3, 0.3, 0.3),
        lambda actor, action, part: np.array([*part[:3], -part[4], part[3]]), _QPG,
    ),
    "direct": ActionMode("cup", (-0.011,), (0.011,), lambda actor, action, part: part),
    "rotation_bottom": ActionMode(
        "cup", (-0.01, -0.01, -0.015), (0.01, 0.01, 0.015), lambda actor, action, part: part
    ),
}  # fmt: skip
_PICKERS = ("picker", "pickerpickplace", "picker_qpg")
MODES_OF = {  # The default mode first.
    "PassWater": ("direct",), "PourWater": ("rotation_bottom",),
    "PourWaterAmount": ("rotation_bottom",), "RopeFlatten": ("picker",),
    "RopeConfiguration": ("picker",), "ClothFlatten": _PICKERS, "ClothFold": _PICKERS,
    "ClothFoldCrumpled": _PICKERS, "ClothDrop": ("picker",), "ClothFoldDrop": ("picker",),
}  # fmt: skip
