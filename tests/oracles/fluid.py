"""A slow numpy version of the plugin's step: the oracle of its tests, and its method in short.

Position-based fluid (Macklin and Mueller, 2013) in small substeps of one Jacobi iteration each.
Every pair within reach is found by brute force and everything is in double precision; otherwise
it is the same arithmetic in the same order as `plugin/solver.cc` and `plugin/kernels_impl.h`.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np

from tests.oracles.fluid_flexes import NO_FLEXES, Contact, Flexes, find_nearest

# As in plugin/solver.cc, where the reasons are.
SUPPORT = 1.83
REST_DENSITY = 0.632
WALL_DENSITY = 24.3
RELAXATION = 0.45
CORRECTION = 0.4
CONTACT = 0.3
VISCOSITY_PASS = 0.7
LAPLACIAN = 4 * np.pi * SUPPORT**3 / 280 / 6
# As in plugin/lists.cc.
NUDGE = 0.01
# As in plugin/kernels_impl.h.
DIG_OUT = 0.1
APPROACH = 0.9


@dataclasses.dataclass(frozen=True)
class Fluid:
    """Settings of a fluid, as the attributes of the plugin (SI units)."""

    spacing: float
    substeps: int
    viscosity: float = 2e-4
    cohesion: float = 0.0
    friction: float = 0.01
    density: float = 1000.0
    max_speed: float = 10.0

    @property
    def radius(self) -> float:
        """Support of the kernel [m]."""
        return SUPPORT * self.spacing

    @property
    def particle_mass(self) -> float:
        """Mass of a particle [kg]."""
        return self.density * self.spacing**3


@dataclasses.dataclass(frozen=True)
class Pose:
    """Position (3,) [m] and unit quaternion (w, x, y, z)."""

    position: np.ndarray
    quaternion: np.ndarray

    @property
    def matrix(self) -> np.ndarray:
        """Rotation matrix (3, 3)."""
        w, x, y, z = self.quaternion
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )

    def to_local(self, points: np.ndarray) -> np.ndarray:
        """World points (n, 3) in the frame of the pose."""
        return (points - self.position) @ self.matrix


@dataclasses.dataclass(frozen=True)
class Wall:
    """A geom that holds particles back, and its poses at the start and end of a step."""

    shape: str  # "plane", "sphere", "capsule", "ellipsoid", "cylinder" or "box".
    size: np.ndarray  # As mjModel.geom_size.
    start: Pose
    end: Pose

    def at(self, fraction: float) -> Pose:
        """The pose after a fraction of the step."""
        a, b = self.start, self.end
        turned = b.quaternion * (-1.0 if a.quaternion @ b.quaternion < 0 else 1.0)
        quaternion = a.quaternion + fraction * (turned - a.quaternion)
        return Pose(
            a.position + fraction * (b.position - a.position),
            quaternion / np.linalg.norm(quaternion),
        )

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Signed distance (n,) [m] and outward normal (n, 3) of points in the wall's frame."""
        size = self.size
        if self.shape == "plane":
            return points[:, 2], np.tile([0.0, 0.0, 1.0], (len(points), 1))
        if self.shape in ("sphere", "capsule"):
            offset = points.copy()
            if self.shape == "capsule":
                offset[:, 2] -= np.clip(points[:, 2], -size[1], size[1])
            length = np.linalg.norm(offset, axis=1)
            return length - size[0], offset / length[:, None]
        if self.shape == "ellipsoid":
            scaled = points / size
            gradient = scaled / size
            k0, k1 = np.linalg.norm(scaled, axis=1), np.linalg.norm(gradient, axis=1)
            return k0 * (k0 - 1) / k1, gradient / k1[:, None]
        if self.shape == "cylinder":
            radial = np.linalg.norm(points[:, :2], axis=1)
            flat = np.column_stack([radial, points[:, 2]])
            distance, normal = _box_distance(flat, size[:2])
            direction = points[:, :2] / radial[:, None]
            return distance, np.column_stack([normal[:, :1] * direction, normal[:, 1]])
        return _box_distance(points, size)


def _box_distance(points: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Signed distance to a box in any dimension and its outward normal."""
    excess = np.abs(points) - half
    outside = np.maximum(excess, 0.0)
    length = np.linalg.norm(outside, axis=1)
    inside = np.zeros_like(points)
    inside[np.arange(len(points)), excess.argmax(axis=1)] = 1.0
    far = length > 0
    normal = np.where(far[:, None], outside / np.where(far, length, 1.0)[:, None], inside)
    return np.where(far, length, excess.max(axis=1)), normal * np.copysign(1.0, points)


def _pairs(positions: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Indices i, j of all ordered pairs within reach, and x_i - x_j (m, 3)."""
    offsets = positions[:, None] - positions[None]
    near = np.linalg.norm(offsets, axis=2) < radius
    np.fill_diagonal(near, False)
    i, j = np.nonzero(near)
    return i, j, offsets[i, j]


def _total(count: int, index: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Sums of `values` by `index`: (count, ...)."""
    total = np.zeros((count, *values.shape[1:]))
    np.add.at(total, index, values)
    return total


def _filled(fluid: Fluid, distance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the share (n,) of kernels filled behind walls at distances, and its slope (n,)."""
    u = np.clip(1 - distance / fluid.radius, 0.0, 1.0)
    share = WALL_DENSITY / REST_DENSITY * u**5 * (1 / 20 - u / 30)
    return share, WALL_DENSITY / 3 * u**4 * (1 / 4 - u / 5)


def _wall_share(fluid: Fluid, wall: Wall, pose: Pose, positions: np.ndarray):
    """Returns the share of kernels that a wall fills (n,), its slope (n,) and normals (n, 3)."""
    distance, normal = wall.distance(pose.to_local(positions))
    return *_filled(fluid, distance), normal @ pose.matrix.T


def _flex_share(fluid: Fluid, flexes: Flexes, corners: np.ndarray, x: np.ndarray):
    """Returns share, slope and normals of the nearest cloth, and its index: a list of n."""
    near = [find_nearest(fluid, flexes, corners, p) for p in x]
    share, slope = _filled(fluid, np.array([n.distance for n in near]))
    facing = np.array([n.facing for n in near])
    return facing * share, facing * slope, np.array([n.normal for n in near]), near


def _impulse(rate: float, positions: np.ndarray, changes: np.ndarray) -> np.ndarray:
    """(6,): what a wall took up when particles at `positions` were moved by `changes`."""
    return -rate * np.concatenate([changes.sum(axis=0), np.cross(positions, changes).sum(axis=0)])


def _nudges(fluid: Fluid, positions: np.ndarray) -> np.ndarray:
    """Returns displacements (n, 3) of particles that coincide with an earlier one."""
    nudges = np.zeros_like(positions)
    for i, x in enumerate(positions):
        if not (positions[:i] == x).all(axis=1).any():
            continue
        number = i
        for k in range(3):
            number = ((number ^ (number >> 15)) * 2246822519 + 2654435769) % 2**32
            nudges[i, k] = NUDGE * fluid.spacing * ((number >> 8) / 2**23 - 1)
    return nudges


def _substep(fluid, h, gravity, walls, flexes, fractions, x, v, impulses):
    count, radius, scale = len(x), fluid.radius, fluid.radius / 3
    old = x
    v = v + h * gravity
    limit = min(fluid.max_speed, 0.5 * radius / h)
    v = v * np.minimum(1.0, limit / np.maximum(np.linalg.norm(v, axis=1), 1e-30))[:, None]
    x = x + h * v
    starts = [wall.at(fractions[0]) for wall in walls]
    ends = [wall.at(fractions[1]) for wall in walls]
    before, after = flexes.at(fractions[0]), flexes.at(fractions[1])

    shares = [_wall_share(fluid, w, end, x) for w, end in zip(walls, ends, strict=True)]
    free = np.prod([1 - share for share, _, _ in shares] or [np.ones(count)], axis=0)
    flex_share, flex_slope, flex_normal, near = _flex_share(fluid, flexes, after, x)
    free = free * (1 - flex_share)
    flex_slope *= free / (1 - flex_share)
    slopes = [slope * free / (1 - share) for share, slope, _ in shares]
    gradient = flex_slope[:, None] * flex_normal
    for slope, (_, _, normal) in zip(slopes, shares, strict=True):
        gradient += slope[:, None] * normal

    i, j, offset = _pairs(x, radius)
    length = np.maximum(np.linalg.norm(offset, axis=1), 1e-30)
    s = 1 - length / radius
    e = (s**2 / length)[:, None] * offset
    gradient += _total(count, i, e)
    density = _total(count, i, s**3) + REST_DENSITY * (1 - free)
    excess = np.maximum(density / REST_DENSITY - 1, 0.0)
    squares = (gradient**2).sum(axis=1) + _total(count, i, s**4)
    pressure = excess / (squares + 1e-6)
    factor = RELAXATION * REST_DENSITY * scale
    change = factor * (pressure[:, None] * gradient + _total(count, i, pressure[j, None] * e))
    norm = np.linalg.norm(change, axis=1)
    largest = CORRECTION * fluid.spacing
    change *= np.minimum(1.0, largest / np.maximum(norm, 1e-30))[:, None]
    q = length / radius
    pull = -6.75 * fluid.cohesion * h**2 * q**2 * (1 - q)
    change += _total(count, i, (pull / length)[:, None] * offset)
    change += _nudges(fluid, x)

    contact = Contact(fluid, CONTACT * fluid.spacing, flexes, before, after)
    pushes = factor * pressure * flex_slope
    reached = [contact.collide(*a) for a in zip(old, x + change, near, pushes, strict=True)]
    change = np.array(reached) - x
    for k, wall in enumerate(walls):
        push = factor * pressure * slopes[k]
        moved = _collide(fluid, wall, starts[k], ends[k], old, x + change, push)
        change = change + moved
        taken = moved + push[:, None] * shares[k][2]
        impulses[k] += _impulse(fluid.particle_mass / h, x + change, taken)
    change = np.array([contact.guard(*a) for a in zip(old, x + change, strict=True)]) - x
    return x + change, v + change / h


def _collide(fluid, wall, start, end, old, x, pressure_push):
    """Displacement (n, 3) that keeps particles on their way from `old` to `x` out of a wall."""
    contact = CONTACT * fluid.spacing
    before, after = start.to_local(old), end.to_local(x)
    old_distance, _ = wall.distance(before)
    way = after - before
    length = np.maximum(np.linalg.norm(way, axis=1), 1e-6)
    limit = np.where(old_distance > 0, APPROACH * old_distance, contact)
    way = way * np.minimum(limit / length, 1.0)[:, None]
    reached = before + way
    distance, normal = wall.distance(reached)
    most = np.where(distance > 0, contact, DIG_OUT * fluid.spacing)
    push = np.minimum(np.maximum(contact - distance, 0.0), most)
    slide = way - (way * normal).sum(axis=1, keepdims=True) * normal
    slid = np.maximum(np.linalg.norm(slide, axis=1), 1e-6)
    grip = np.minimum(fluid.friction * (push + pressure_push) / slid, 1.0)
    local = reached + push[:, None] * normal - grip[:, None] * slide
    return (local - after) @ end.matrix.T


def _smooth(fluid, timestep, h, walls, flexes, fraction, x, v, impulses):
    """Viscosity, once a step."""
    count, radius = len(x), fluid.radius
    total = fluid.viscosity * timestep / (LAPLACIAN * radius**2)
    passes = max(1, int(np.ceil(total / VISCOSITY_PASS)))
    viscosity = total / passes
    i, j, offset = _pairs(x, radius)
    weight = (1 - np.linalg.norm(offset, axis=1) / radius) ** 3
    before, after = flexes.at(fraction), flexes.at(1.0)
    flex_share, _, _, near = _flex_share(fluid, flexes, after, x)
    for _ in range(passes):
        v = v + _total(count, i, viscosity * weight[:, None] * (v[j] - v[i]))
        for k, wall in enumerate(walls):
            start, end = wall.at(fraction), wall.at(1.0)
            share = np.minimum(viscosity * REST_DENSITY * _wall_share(fluid, wall, end, x)[0], 1.0)
            turn = (end.matrix - start.matrix) @ end.matrix.T / h
            omega = np.array(
                [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
            )
            velocity = (end.position - start.position) / h
            wall_velocity = velocity + np.cross(omega / 2, x - end.position)
            change = share[:, None] * (wall_velocity - v)
            v = v + change
            impulses[k] += _impulse(fluid.particle_mass, x, change)
        for n in np.flatnonzero(flex_share):
            moved = near[n].weights @ (after - before)[near[n].element]
            share = min(viscosity * REST_DENSITY * flex_share[n], 1.0)
            v[n] += share * (moved / h - v[n])
    return v


def step(
    fluid: Fluid,
    timestep: float,
    gravity: np.ndarray,
    walls: Sequence[Wall],
    positions: np.ndarray,
    velocities: np.ndarray,
    flexes: Flexes = NO_FLEXES,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Advances particles by one step.

    Args:
        fluid: the settings.
        timestep: [s].
        gravity: (3,) [m/s^2].
        walls: in the order of the geoms in the model; each moves from `start` to `end`.
        positions: (n, 3) [m].
        velocities: (n, 3) [m/s].
        flexes: cloth and ropes that hold particles back.

    Returns:
        Positions, velocities and impulses on the walls (len(walls), 6): linear [N s], then their
        moments about the world origin [N m s].
    """
    x, v = np.array(positions, float), np.array(velocities, float)
    impulses = np.zeros((len(walls), 6))
    h = timestep / fluid.substeps
    for s in range(fluid.substeps):
        fractions = (s / fluid.substeps, (s + 1) / fluid.substeps)
        x, v = _substep(fluid, h, np.asarray(gravity), walls, flexes, fractions, x, v, impulses)
    if fluid.viscosity:
        fraction = (fluid.substeps - 1) / fluid.substeps
        v = _smooth(fluid, timestep, h, walls, flexes, fraction, x, v, impulses)
    return x, v, impulses


def compression(positions, spacing):
    """Solver density of every particle over the density at rest, by brute force."""
    radius = SUPPORT * spacing
    total = np.zeros(len(positions))
    for i, x in enumerate(positions):
        r = np.linalg.norm(positions - x, axis=1)
        s = 1 - r[r < radius] / radius
        total[i] = (s**3).sum() - 1.0  # Without the particle itself.
    return total / REST_DENSITY
