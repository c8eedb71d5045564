"""The task FoldShirt: sleeves in, then the hem over to the shoulders, beyond SoftGym."""

import dataclasses
from collections.abc import Mapping
from typing import Unpack

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.fabric import THICKNESS
from softgym_mj.entities.shirt import FABRIC, KEYS, Shirt
from softgym_mj.exceptions import check_name
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.workspace import ToolStart, Workspace
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.entries import Entries, points
from softgym_mj.tasks.shared.settings import ClothTaskSettings
from softgym_mj.tasks.shared.starts.shirts import CUTS, FlatShirt
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.shared.symmetry import two_sided

# [m] Depth by which hands come nearer to the floor than in other tasks, because layers are thinner.
LOWER = (THICKNESS - FABRIC.thickness) / 2.0
STACK = 0.1  # [m] Height up to which a vertex may lie over its place: loose stacks have 9 cm.


class FoldShirt(Task):
    """Fold a shirt: sleeves in, then the hem over to the shoulders.

    Goal: each sleeve is folded inward at its armhole, then the lower half of the shirt over the
    upper half, which has not moved.
    Actions: per picker dx, dy, dz (1 is 0.01 m per sim step) and grip (closes if > 0), each in [-1,
    1].
    Observations: `reduced` (default) lists 11 key points (collar, shoulders, armpits, both ends of
    each cuff, ends of the hem) and picker 0, picker 1 (x, y, z each): 39 entries [m].
    `OBSERVATIONS` of `tasks.shared.observations` lists the others.
    Reward = performance: -(mean distance of the shirt from its place) [m], over its area, in top
    view; only heights above 10 cm add to a distance. The two terms of the reward are the parts of
    this mean from the body and from the sleeves.
    Bounds: lower = performance at reset, upper = 0.
    Horizon: 200 env steps of 8 sim steps; nothing else ends an episode.
    Start: a T-shirt or a shirt with long sleeves, 0.34 to 0.44 m wide and 0.46 to 0.58 m long, lies
    flat on its back, the hem at -X, rotated by up to 45 degrees. With `cuts="unseen"` it is a
    flared dress, 0.66 to 0.74 m long.
    """

    summary = "Fold a shirt: sleeves in, then the hem over to the shoulders."
    difficulty, material = "hard", "cloth"
    horizon, example_variation = 200, 909
    success = 0.9  # Our choice; a shirt folded but for its sleeves has at most 0.88.
    workspace = Workspace((-0.85, -0.85, 0.0), (0.85, 0.85, 0.5))
    reset_height, view = 0.1, "fold_shirt"
    symmetries = two_sided()

    def __init__(
        self,
        *,
        fidelity: str = "default",
        cuts: str = "usual",
        **settings: Unpack[ClothTaskSettings],
    ):
        """Builds the task.

        Args:
            fidelity: resolution of the shirt: "fast", "default" or "accurate".
            cuts: kinds of cuts: "usual" for T-shirts and long sleeves, or "unseen" for dresses, to
                measure generalization.
            **settings: entries of `ClothTaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        check_name("cuts", cuts, CUTS)
        self.shirt = Shirt(fidelity=fidelity)
        super().__init__([self.shirt], FlatShirt(fidelity, cuts), **settings)

    def tool_start(self, points: dict[str, np.ndarray]) -> ToolStart:
        start = super().tool_start(points)
        if self.actor.least_distance == 0.0:  # Pickers have no fingers.
            return start
        (x, y, z), high = start.workspace.low, start.workspace.high
        return dataclasses.replace(start, workspace=Workspace((x, y, z - LOWER), high))

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Returns the place of each vertex of the folded shirt "places" (n, 2) [m]."""
        return {"places": folded(points["shirt"][:, :2], self.shirt.arrays)}

    def measure(self, state: State, episode: Episode) -> Measures:
        shape, found = episode.shapes["shirt"], state.points["shirt"]
        xp = metrics.namespace(found)
        above = xp.clip(found[..., 2:] - STACK, 0.0, None)
        away = xp.concat([found[..., :2] - episode.goal["places"], above], axis=-1)
        distances = metrics.lengths(away)
        body, sleeves = (xp.sum(shape[part] * distances, axis=-1) for part in ("body", "sleeves"))
        rewards = {"body_distance": -body, "sleeve_distance": -sleeves}
        return Measures(-body - sleeves, rewards)

    def bounds(self, episode: Episode) -> tuple[Array, Array]:
        return episode.initial_performance, 0.0

    def reduced(self, state: State, episode: Episode) -> Entries:
        keys = metrics.taken(state.points["shirt"], episode.shapes["shirt"]["keys"])
        return {f"{len(KEYS)} key points of the shirt": points(keys, "object")}


def folded(flat: np.ndarray, shape: Mapping[str, np.ndarray]) -> np.ndarray:
    """Returns the places (n, 2) [m] of the vertices of a folded shirt.

    Args:
        flat: vertices (n, 2) [m] of the flat shirt.
        shape: `Shirt.arrays`.
    """
    keys, places = _by_name(flat, shape), with_sleeves_in(flat, shape)
    hem, shoulders = (
        (keys[f"left {name}"] + keys[f"right {name}"]) / 2 for name in ("hem", "shoulder")
    )
    across = hem - shoulders
    lower = _along(places - (hem + shoulders) / 2, across) > 0.0
    return np.where(lower[:, None], _reflected(places, (hem + shoulders) / 2, across), places)


def with_sleeves_in(flat: np.ndarray, shape: Mapping[str, np.ndarray]) -> np.ndarray:
    """Returns vertices (n, 2) [m] with each sleeve reflected across the line of its armhole."""
    keys, places = _by_name(flat, shape), flat
    is_sleeve = shape["body"] == 0.0
    for side, is_own in (("left", shape["is_left"]), ("right", ~shape["is_left"])):
        armpit, shoulder = keys[f"{side} armpit"], keys[f"{side} shoulder"]
        across = (shoulder - armpit)[::-1] * [1.0, -1.0]
        turned = _reflected(places, armpit, across)
        places = np.where((is_sleeve & is_own)[:, None], turned, places)
    return places


def _by_name(flat: np.ndarray, shape: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return dict(zip(KEYS, flat[shape["keys"]], strict=True))


def _along(points: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Returns the coordinates (n,) of points (n, 2) along an axis (2,), in its lengths."""
    return (points * axis).sum(axis=-1) / (axis * axis).sum()


def _reflected(points: np.ndarray, origin: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Returns points (n, 2) reflected across the line through a point, with a normal (2,)."""
    return points - 2.0 * _along(points - origin, normal)[:, None] * normal
