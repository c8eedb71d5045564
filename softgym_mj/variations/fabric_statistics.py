"""Random fabrics with realistic, correlated density, bending stiffness and anisotropy.

They follow statistics of 618 fabrics that Feng et al. measured with a cantilever (Learning-based
bending stiffness parameter estimation by a drape tester, 2022).
"""

from collections.abc import Sequence

import numpy as np

# Density bands [g/m^2], number of fabrics in each, and 10, 50 and 90 % quantiles of their bending
# stiffness [uN m].
LEAST_DENSITY = 15.0
BANDS = (
    (60.0, 63, (0.7, 1.3, 7.3)),
    (100.0, 84, (1.6, 4.1, 14.0)),
    (150.0, 90, (2.7, 7.7, 13.0)),
    (200.0, 84, (4.0, 17.0, 36.0)),
    (300.0, 155, (5.4, 18.0, 42.0)),
    (400.0, 71, (10.0, 34.0, 78.0)),
    (870.0, 71, (19.0, 51.0, 116.0)),
)
BENDING_SHARES = (0.1, 0.5, 0.9)
# 5, 50 and 95 % quantiles of the ratio of warp and weft stiffness.
RATIO_SHARES, RATIOS = (0.05, 0.5, 0.95), (0.4, 1.5, 4.6)
# No data is published for these: assumed ranges from a sheet along the flow to more than a plate
# across it, and from polished to rough tables.
DRAGS, FRICTIONS = (0.8, 2.0), (0.2, 1.0)

# Domain parameters that are drawn together, and their ranges; the ratio is in `bend_weft`.
_BENDING = (BANDS[0][2][0] * 1e-6, BANDS[-1][2][2] * 1e-6)
RANGES = {
    "density": (LEAST_DENSITY * 1e-3, BANDS[-1][0] * 1e-3),
    "bend_stiffness": (_BENDING[0] * RATIOS[0] ** 0.5, _BENDING[1] * RATIOS[2] ** 0.5),
    "bend_weft": (_BENDING[0] * RATIOS[2] ** -0.5, _BENDING[1] * RATIOS[0] ** -0.5),
    "bend_bias": _BENDING,
    "drag": DRAGS,
    "friction": FRICTIONS,
    "layer_friction": FRICTIONS,
}


def draw(random: np.random.Generator) -> dict[str, float]:
    """Draws a fabric: domain parameters by name (those of `RANGES`).

    A band is drawn by its number of fabrics, a density in it log-uniformly, a stiffness within the
    middle 80 % of the band, and a ratio of warp and weft within the middle 90 % of all. The
    stiffness is their geometric mean, and that at 45 degrees.
    """
    counts = np.array([count for _, count, _ in BANDS], float)
    which, place, share, other, drag, friction, layers = random.random(7).tolist()
    band = int(np.searchsorted(np.cumsum(counts) / counts.sum(), which, side="right"))
    low = LEAST_DENSITY if band == 0 else BANDS[band - 1][0]
    density = low * (BANDS[band][0] / low) ** place
    bending = 1e-6 * _quantile(share, BENDING_SHARES, BANDS[band][2])
    ratio = _quantile(other, RATIO_SHARES, RATIOS)
    return {
        "density": 1e-3 * density,
        "bend_stiffness": bending * ratio**0.5,
        "bend_weft": bending / ratio**0.5,
        "bend_bias": bending,
        "drag": _between(drag, DRAGS),
        "friction": _between(friction, FRICTIONS),
        "layer_friction": _between(layers, FRICTIONS),
    }


def _quantile(fraction: float, shares: Sequence[float], values: Sequence[float]) -> float:
    """Returns the quantile of a fraction (0..1) between the first and the last given share.

    In between, shares are linear in the logarithm.
    """
    share = shares[0] + fraction * (shares[-1] - shares[0])
    return float(np.exp(np.interp(share, shares, np.log(values))))


def _between(fraction: float, limits: Sequence[float]) -> float:
    return limits[0] + fraction * (limits[1] - limits[0])
