"""What numbers make an engine's sheet as stiff and as rough as the fabric says.

Three experiments on small sheets, of the study's own cells unless others are said: a strip hangs
from its end, another is clamped and bends, a square slides down a slope. What they give, compared
with closed forms, corrects the numbers that the engine is given, until they agree.
"""

import dataclasses
from collections.abc import Callable

import numpy as np
import scipy.integrate

from benchmarks.engines.sheets import FABRIC, GRAVITY, SPACING, STEP, Build, Simulation
from softgym_mj.entities.sheet import Fabric
from softgym_mj.reality.lab import theory
from softgym_mj.reality.meshes import rectangle

CLOSE = 0.02  # Share by which what is measured may be off.
ROUNDS = 6
_CORRECTION = (0.2, 5.0)  # In one round.

STRIP, WIDTH = 12, 4  # Cells along and across the strip that hangs.
STRAIN = 0.01  # Mean of it; its weight is made such.
BEAM = 4  # Cells that bend.
LOAD = 5.0  # Of the beam: weight per length times length^3 over bending stiffness.
OTHER_LOAD = 1.0  # Of the shape in which it starts again.
SAME = 0.25  # Share by which what is measured may hang by the start.
SQUARE = 7  # Cells a side of what slides.
SLOPE = 1.5  # Tangent over friction.


def hanging(
    build: Build, fabric: Fabric, wanted: Fabric = FABRIC, spacing: float = SPACING
) -> float:
    """Force per width and strain [N/m] of a strip that hangs.

    Args:
        build, fabric: the engine, and what it is given.
        wanted: what that is to be, by which the load is chosen.
        spacing: between vertices [m].
    """
    mesh = rectangle(STRIP * spacing, WIDTH * spacing, spacing)
    weight = hanging_weight(wanted, spacing)
    simulation = build(mesh, fabric, mesh.points, np.array([weight, 0.0, 0.0]), False)
    order = np.argsort(mesh.points[:, 0], kind="stable").reshape(STRIP + 1, WIDTH + 1)
    _clamped(simulation, order[0], 50)
    places = [positions[order, 0].mean(axis=1) for positions in _kept(simulation, order[0])]
    simulation.close()
    strain = np.diff(np.mean(places, axis=0)) / spacing - 1.0
    return stretch_of(strain, fabric.density, weight, spacing)


def hanging_weight(wanted: Fabric = FABRIC, spacing: float = SPACING) -> float:
    """Gravity [m/s^2] with which the strip's mean strain is `STRAIN`."""
    return 2.0 * STRAIN * wanted.stretch_stiffness / (wanted.density * STRIP * spacing)


def stretch_of(
    strain: np.ndarray, density: float, weight: float, spacing: float = SPACING
) -> float:
    """Force per width and strain [N/m] of a hanging strip whose rows of vertices weigh the same.

    Args:
        strain: (n,) of its rows of cells, from the clamp on; the outer two are left out.
        density: [kg/m^2]
        weight: acceleration that pulls [m/s^2].
        spacing: between rows [m].
    """
    cells = len(strain)
    row = density * spacing * cells / (cells + 1)  # Mass per width.
    force = row * weight * np.arange(cells, 0, -1)
    return float(force[2:-2].sum() / strain[2:-2].sum())


def bending(
    build: Build,
    fabric: Fabric,
    wanted: Fabric = FABRIC,
    spacing: float = SPACING,
    start: float = LOAD,
) -> float:
    """Moment per width and curvature [N m] of a strip that bends under its weight.

    It is looked at over a period of its first mode. It starts as the elastica of the load `start`:
    the one that it should be, so that it swings little, or another one, to see whether it moves.
    """
    mesh = rectangle((BEAM + 1) * spacing, WIDTH * spacing, spacing)
    # Half a cell of what is clamped bends, too: the hinges of its second row.
    length = (BEAM + 0.5) * spacing
    nominal = wanted.bend_stiffness
    weight = LOAD * nominal / (wanted.density * length**3)
    order = np.argsort(mesh.points[:, 0], kind="stable").reshape(BEAM + 2, WIDTH + 1)
    distance, drop = elastica(start)
    # Along it, from half a cell before the first vertex that is free.
    arc = spacing * (np.arange(BEAM + 2) - 0.5)
    share = np.clip(arc / length, 0.0, 1.0)
    points = mesh.points.copy()
    clamp = mesh.points[order[0, 0], 0] + spacing / 2
    for row, s, a in zip(order, share, arc, strict=True):
        places = np.linspace(0.0, 1.0, len(distance))
        points[row, 0] = clamp + (a if a < 0 else length * np.interp(s, places, distance))
        points[row, 2] = -length * np.interp(s, places, drop)
    points[order[1], 2] = 0.0  # Clamped level, half a cell out.
    points[order[1], 0] = clamp + spacing / 2
    simulation = build(mesh, fabric, points, np.array([0.0, 0.0, -weight]), False)
    held = order[:2].ravel()
    period = 2.0 * np.pi / 3.516 * length**2 * np.sqrt(wanted.density / nominal)
    _clamped(simulation, held, round(period / STEP / 2))
    tips = []
    for positions in _kept(simulation, held, round(period / STEP)):
        tips.append(positions[order[-1]].mean(axis=0))
    simulation.close()
    tip = np.mean(tips, axis=0)
    ratio = max(-tip[2], 1e-3) / max(tip[0] - clamp, 1e-3)
    load = theory.load_of(float(np.clip(ratio, 0.02, 50.0)))
    return fabric.density * weight * length**3 / load


def elastica(load: float, number: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Distance and drop (number,) of points of a clamped beam, evenly along it, over its length.

    Its slope a obeys a'' = -load (1 - s) cos a, with a(0) = 0 and a'(1) = 0.
    """
    s = np.linspace(0.0, 1.0, number)

    def slope(at, y):
        return np.vstack([y[1], -load * (1.0 - at) * np.cos(y[0])])

    def ends(first, last):
        return np.array([first[0], last[1]])

    found = scipy.integrate.solve_bvp(slope, ends, s, np.vstack([s, 1.0 - s]), tol=1e-8)
    angle = found.sol(s)[0]
    along = scipy.integrate.cumulative_trapezoid(np.cos(angle), s, initial=0.0)
    below = scipy.integrate.cumulative_trapezoid(np.sin(angle), s, initial=0.0)
    return along, below


def sliding(
    build: Build, fabric: Fabric, wanted: Fabric = FABRIC, spacing: float = SPACING
) -> float:
    """Coefficient of friction of a sheet that slides down a slope."""
    mesh = rectangle(SQUARE * spacing, SQUARE * spacing, spacing)
    start = mesh.points + [0.0, 0.0, fabric.thickness / 2]
    slope = SLOPE * wanted.friction
    angle = np.arctan(slope)
    gravity = GRAVITY * np.array([np.sin(angle), 0.0, -np.cos(angle)])
    simulation = build(mesh, fabric, start, gravity, True)
    ways = []
    for _ in range(3):
        ways.append(simulation.positions()[:, 0].mean())
        _clamped(simulation, np.zeros(0, int), 25)
    ways.append(simulation.positions()[:, 0].mean())
    simulation.close()
    # Of the last half second: how it got there does not matter.
    acceleration = (ways[3] - 2.0 * ways[2] + ways[1]) / 0.25**2
    return friction_of(acceleration, slope)


def friction_of(acceleration: float, slope: float) -> float:
    """Coulomb's coefficient of what slides down a slope (a tangent) so fast [m/s^2]."""
    return float(slope - acceleration / (GRAVITY * np.cos(np.arctan(slope))))


def _clamped(simulation: Simulation, vertices: np.ndarray, steps: int) -> None:
    simulation.hold(vertices)
    places = simulation.positions()[vertices]
    for _ in range(steps):
        simulation.step(places)


def _kept(simulation: Simulation, vertices: np.ndarray, steps: int = 50):
    """Positions (n, 3) [m] after each of so many more steps."""
    places = simulation.positions()[vertices]
    for _ in range(steps):
        simulation.step(places)
        yield simulation.positions()


# Experiments by what they say of the fabric; of friction, both coefficients are the same.
Experiment = Callable[[Build, Fabric, Fabric, float], float]
EXPERIMENTS: dict[str, tuple[Experiment, tuple[str, ...]]] = {
    "stretch_stiffness": (hanging, ("stretch_stiffness",)),
    "bend_stiffness": (bending, ("bend_stiffness",)),
    "friction": (sliding, ("friction", "layer_friction")),
}


@dataclasses.dataclass(frozen=True)
class Calibration:
    """How an engine is given a fabric.

    Attributes:
        given: numbers that make it what it should be, by field of the fabric.
        measured: pairs of a number that was given and what was measured, in order, by experiment.
        restarted: bending [N m] measured with the last of these from another start; None if not.
    """

    given: dict[str, float]
    measured: dict[str, list[tuple[float, float]]]
    restarted: float | None = None

    def fabric(self, fabric: Fabric = FABRIC) -> Fabric:
        """A fabric with these numbers."""
        return dataclasses.replace(fabric, **self.given)


def calibrate(
    build: Build, fabric: Fabric = FABRIC, rounds: int = ROUNDS, spacing: float = SPACING
) -> Calibration:
    """Corrects what an engine is given until it measures as the fabric, or `rounds` times.

    That is on meshes with so much between vertices [m].
    """
    given, measured = fabric, {}
    for name, (experiment, fields) in EXPERIMENTS.items():
        wanted = getattr(fabric, name)
        tried: list[tuple[float, float]] = []
        for _ in range(rounds):
            found = experiment(build, given, fabric, spacing)
            tried.append((getattr(given, name), found))
            if abs(found / wanted - 1.0) < CLOSE:
                break
            number = corrected(tried, wanted)
            given = dataclasses.replace(given, **dict.fromkeys(fields, number))
        # The nearest of all, if none is close.
        best = min(tried, key=lambda pair: abs(np.log(max(pair[1], 1e-12) / wanted)))[0]
        given = dataclasses.replace(given, **dict.fromkeys(fields, best))
        measured[name] = tried
    fields = [field for _, fields in EXPERIMENTS.values() for field in fields]
    return Calibration({field: getattr(given, field) for field in fields}, measured)


def corrected(rounds: list[tuple[float, float]], wanted: float) -> float:
    """The next number to try: proportionally at first, then by the secant of logarithms.

    Args:
        rounds: pairs of a number that was given and what was measured.
        wanted: what should be measured.
    """
    given, found = rounds[-1]
    power = 1.0
    if len(rounds) > 1 and rounds[-2][0] != given:
        before, earlier = rounds[-2]
        rise = np.log(max(found, 1e-12) / max(earlier, 1e-12)) / np.log(given / before)
        if 0.2 < rise < 5.0:
            power = 1.0 / rise
    return float(given * np.clip((wanted / max(found, 1e-12)) ** power, *_CORRECTION))
