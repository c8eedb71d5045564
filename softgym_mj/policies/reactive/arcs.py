"""Half circles about lines on the floor, on which the held ends of a shirt turn."""

import math

from softgym_mj.metrics import Array, namespace

PACE = 0.05  # [m] Way along a circle in an env step.
# Braking: share of the remaining angle, and angle [rad], of an env step.
BRAKING, CREEP = 0.4, 0.05
# [m] Distance before its place at which a vertex is released, as folds spring back by a few
# millimeters; its height then.
SHORT, LAID = -0.003, 0.022


def turned(away: list[tuple[Array, Array]], radii: list[Array]) -> list[tuple[Array, Array]]:
    """Returns distances from the axis (...), horizontal and up, a step later on half circles.

    Args:
        away: the same before, of both ends [m].
        radii: of their circles (...) [m].
    """
    xp = namespace(radii[0])
    across, height = away[0][0] + away[1][0], away[0][1] + away[1][1]
    angle = xp.atan2(over(across / 2, height / 2), across / 2)
    pace = 2.0 * PACE / xp.clip(radii[0] + radii[1], 0.01, None)
    slowed = BRAKING * (math.pi - angle) + CREEP
    angle = xp.clip(angle + xp.minimum(pace, slowed), None, math.pi)
    cosine, sine = xp.cos(angle), xp.sin(angle)
    share = (1.0 - cosine) / 2
    return [(radius * cosine + SHORT * share, radius * sine + LAID * share) for radius in radii]


def over(across: Array, height: Array) -> Array:
    """Returns the height (...) [m] over a circle's ends, the second of which is higher."""
    xp = namespace(height)
    size = xp.sqrt(across * across + height * height)
    share = (1.0 - across / xp.clip(size, 0.01, None)) / 2
    return xp.clip(height - LAID * share, 0.0, None)
