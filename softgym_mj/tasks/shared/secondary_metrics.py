"""Secondary metrics in which other work on cloth and rope reports outcomes.

They are functions of arrays, of one simulation or of a batch, and appear in info and results.
"""

import numpy as np

from softgym_mj import metrics
from softgym_mj.metrics import Array
from softgym_mj.tasks.shared.state import Episode, State

AROUND = [0, 1, 3, 2, 0]  # Closed polygon through the corners of `outline`.
LINES = 64  # Scan lines for covered areas: accurate to 0.1 % here, at half the default cost.


def flattening(area: Array, start: Array, flat: Array) -> dict[str, Array]:
    """Returns normalized coverage (Lin et al., 2021, VCD) and improvement (Ha and Song, 2021).

    Args:
        area: (...) covered area in top view.
        start: (...) covered area at the start.
        flat: (...) area of the flat cloth.
    """
    return {
        "normalized_coverage": area / flat,
        "normalized_improvement": metrics.normalize(area, start, flat),
    }


def outline(particles: np.ndarray, folded: bool) -> np.ndarray:
    """Returns the corners (4, 3) [m] of the area to cover: of its last column, then opposite.

    Args:
        particles: (dimy, dimx, 3) [m] SoftGym's particles of the flat cloth at its goal.
        folded: whether the first half has to lie on the second; else the cloth lies flat.
    """
    middle = (particles.shape[1] - 1) / 2 if folded else 0.0
    columns = [int(np.floor(middle)), int(np.ceil(middle))]
    opposite = particles[:, columns].mean(axis=1)
    return np.stack([*particles[[0, -1], -1], *opposite[[0, -1]]])


def laying(state: State, episode: Episode, folded: bool) -> dict[str, Array]:
    """Returns how well a cloth lies at its goal `episode.goal["outline"]`, made by `outline`.

    Returns:
        "mean_corner_distance": mean distance of the corners from their places in top view [m].
        "outline_iou": intersection over union of covered and goal area in top view.
        "wrinkle_height": height of the highest point above the upper layer [m].
    """
    points, shape, goal = state.points["cloth"], episode.shapes["cloth"], episode.goal["outline"]
    xp, count = metrics.namespace(points), points.shape[-2]
    places = [0, 1, 0, 1] if folded else [2, 3, 0, 1]  # Goal corners of p1 p2 p3 p4.
    away = metrics.taken(points, shape["corners"]) - metrics.chosen(goal, places)
    sides = [goal[..., i, :2] - goal[..., 0, :2] for i in (1, 2)]
    target = abs(sides[0][..., 0] * sides[1][..., 1] - sides[0][..., 1] * sides[1][..., 0])
    triangles = shape["triangles"]
    both = metrics.constant([[0, 1, 2], [1, 3, 2]], triangles) + count
    both = xp.broadcast_to(both, (*triangles.shape[:-2], 2, 3))
    everything = xp.concat([points, goal], axis=-2), xp.concat([triangles, both], axis=-2)
    union = metrics.covered_area(*everything, LINES)
    common = xp.clip(metrics.covered_area(points, triangles, LINES) + target - union, 0.0, None)
    rest = xp.mean(goal[..., 2], axis=-1)  # Height of a single layer: half its thickness.
    upper = (3.0 if folded else 1.0) * rest
    highest = metrics.highest(points, state.present["cloth"])
    return {
        "mean_corner_distance": xp.mean(metrics.lengths(away[..., :2]), axis=-1),
        "outline_iou": common / union,
        "wrinkle_height": xp.clip(highest - upper, 0.0, None),
    }


def point_error(points: Array, goal: Array) -> dict[str, Array]:
    """Returns the mean distance [m] of a rope's points (..., n, 3) to goal, best direction."""
    xp = metrics.namespace(points)
    directions = (goal, xp.flip(goal, axis=-2))
    errors = [xp.mean(metrics.lengths(points - places), axis=-1) for places in directions]
    return {"mean_point_error": xp.minimum(*errors)}


def straight(points: Array, length: float) -> Array:
    """Returns a straight rope (..., n, 3) [m] with the middle and direction of a rope's ends."""
    count = points.shape[-2]
    first, last = points[..., :1, :], points[..., -1:, :]
    along = last - first
    distance = metrics.lengths(along)[..., None]
    places = metrics.constant(np.linspace(-0.5, 0.5, count)[:, None], points)
    return (first + last) / 2 + length * places * along / (distance + (distance == 0.0))
