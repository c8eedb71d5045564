"""Large deflections of cantilevers under their own weight."""

import numpy as np
import scipy.integrate
import scipy.optimize


def elastica_drop(length: float, weight: float, stiffness: float) -> float:
    """By how much [m] the tip of a clamped beam hangs lower.

    Args:
        length: [m]
        weight: [N/m]
        stiffness: bending moment per curvature [N m^2].
    """
    load = weight * length**3 / stiffness

    def slope(s, y):
        angle, curvature, _ = y
        return [curvature, -load * (1 - s) * np.cos(angle), np.sin(angle)]

    def tip(curvature):
        start = [0.0, curvature, 0.0]
        return scipy.integrate.solve_ivp(slope, (0, 1), start, rtol=1e-8, atol=1e-10).y[:, -1]

    curvature = scipy.optimize.brentq(lambda c: tip(c)[1], 0.0, 6.0 * load + 1.0)
    return length * tip(curvature)[2]


def chain_drop(links: int, spacing: float, weight: float, stiffness: float) -> float:
    """Deflection of rigid links with hinges and with masses at their ends."""
    force = np.full(links, weight * spacing)
    force[-1] /= 2

    def energy(angle):
        bend = np.diff(np.concatenate([[0.0], angle]))
        drop = spacing * np.cumsum(np.sin(angle))
        return (stiffness / spacing * (1 - np.cos(bend))).sum() - (force * drop).sum()

    scale = energy(np.full(links, 0.3))
    found = scipy.optimize.minimize(
        lambda angle: energy(angle) / abs(scale), np.linspace(0.1, 0.5, links), tol=1e-12
    )
    return spacing * float(np.sin(found.x).sum())
