"""`flat_fit`: where a cloth would lie flat, for reactive experts."""

from typing import NamedTuple

from softgym_mj.metrics import Array, lengths, namespace
from softgym_mj.policies.reactive.grasps import Sheet
from softgym_mj.policies.reactive.motions import at

ROUNDS, SCALE = 5, 0.02  # Rounds of reweighting, and distance [m] from which vertices count less.


class Fit(NamedTuple):
    """Flat cloth that fits most of a crumpled one.

    Attributes:
        places: positions of vertices in it (..., n, 2) [m].
        errors: distances of the vertices from them (..., n) [m].
    """

    places: Array
    errors: Array


def flat_fit(sheet: Sheet) -> Fit:
    """Returns the flat cloth, either side up, that fits most of the vertices.

    Iteratively reweighted least squares: folds are outliers.
    """
    xp = namespace(sheet.points)
    counts = xp.astype(sheet.present, sheet.points.dtype)
    fits, costs = [], []
    for mirror in (1.0, -1.0):
        flat = xp.stack([sheet.flat[..., 0], mirror * sheet.flat[..., 1]], axis=-1)
        errors = xp.ones_like(counts)
        for _ in range(ROUNDS):
            places = _moved(flat, sheet.points[..., :2], counts / (SCALE + errors))
            errors = lengths(sheet.points - at(places, xp.zeros_like(counts)))
        fits.append(Fit(places, errors))
        costs.append(xp.sum(counts * xp.log(SCALE + errors), axis=-1))
    second = costs[1] < costs[0]
    places = xp.where(second[..., None, None], fits[1].places, fits[0].places)
    return Fit(places, xp.where(second[..., None], fits[1].errors, fits[0].errors))


def _moved(points: Array, goals: Array, weights: Array) -> Array:
    """Returns points (..., n, 2) [m], rotated and translated to fit their goals (..., n, 2) best.

    Least squares have a closed form in the plane: with centered points p and goals g as complex
    numbers, the angle is that of the sum of w p* g.

    Args:
        points: (..., n, 2) [m].
        goals: (..., n, 2) [m].
        weights: (..., n).
    """
    xp = namespace(points)
    weights = (weights / xp.sum(weights, axis=-1)[..., None])[..., None]
    center = xp.sum(weights * goals, axis=-2)[..., None, :]
    points = points - xp.sum(weights * points, axis=-2)[..., None, :]
    away = weights * (goals - center)
    x, y, u, v = points[..., 0], points[..., 1], away[..., 0], away[..., 1]
    cosine, sine = xp.sum(x * u + y * v, axis=-1), xp.sum(x * v - y * u, axis=-1)
    size = xp.clip(xp.sqrt(cosine * cosine + sine * sine), 1e-12, None)
    cosine, sine = (cosine / size)[..., None], (sine / size)[..., None]
    return center + xp.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)
