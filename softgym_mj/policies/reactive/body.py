"""`Frame`: horizontal frame of a shirt's upper body, for reactive experts."""

from typing import NamedTuple

from softgym_mj.metrics import Array, namespace
from softgym_mj.policies.reactive.motions import at

# Key points (`entities.shirt.KEYS`): left and right ends of the hem, inner and outer ends of cuffs,
# armpits and shoulders.
HEM, INNER, OUTER, ARMPIT, SHOULDER = (0, 10), (1, 9), (2, 8), (3, 7), (4, 6)
COLLAR = 5
LYING = 0.02  # [m] Height up to which the hem gives directions; it does not from twice that on.
FLARE = 1.08  # Largest width of the hem over that of the chest.


class Frame(NamedTuple):
    """Horizontal frame of the upper body, with its origin at the collar.

    Attributes:
        origin: in the world (..., 2) [m].
        left, up: unit vectors towards the wearer's left and the shoulders (..., 2).
        chest: half the distance of the armholes (...) [m].
        top: height of the shoulders above the origin, along `up` (...) [m].
    """

    origin: Array
    left: Array
    up: Array
    chest: Array
    top: Array

    def local(self, points: Array) -> Array:
        """Returns points (..., k, 3) [m] of the world in the frame."""
        xp = namespace(points)
        away = points[..., :2] - self.origin[..., None, :]
        x, y = (_dot(away, axis[..., None, :]) for axis in (self.left, self.up))
        return xp.stack([x, y, points[..., 2]], axis=-1)

    def world(self, point: Array) -> Array:
        """Returns a point (..., 3) [m] of the frame in the world."""
        across = self.origin + point[..., 0:1] * self.left + point[..., 1:2] * self.up
        return at(across, point[..., 2])


def found_frame(keys: Array) -> Frame:
    """Returns the frame of key points (..., 11, 3) [m].

    The hem counts while it rests, because armholes follow a sleeve that is lifted: inwards.
    """
    xp = namespace(keys)
    (a, b), (c, d), (e, f) = ([keys[..., k, :2] for k in ends] for ends in (ARMPIT, SHOULDER, HEM))
    collar, height = keys[..., COLLAR, :2], xp.max(keys[..., list(HEM), 2], axis=-1)
    weight = (2.0 * xp.clip(2.0 - height / LYING, 0.0, 1.0))[..., None]
    left = a + c - b - d + weight * (e - f)
    up = c + d - a - b + weight * (collar - (e + f) / 2)
    x, y = up[..., 0] - left[..., 1], up[..., 1] + left[..., 0]
    size = xp.clip(xp.sqrt(x * x + y * y), 1e-6, None)
    x, y = x / size, y / size
    left, up = xp.stack([y, -x], axis=-1), xp.stack([x, y], axis=-1)
    sides = [xp.abs(_dot(each - collar, left)) for each in (a, b, c, d)]
    chest = xp.max(xp.stack([*sides, _dot(e - f, left) / (2.0 * FLARE)], axis=-1), axis=-1)
    return Frame(collar, left, up, chest, _dot((c + d) / 2 - collar, up))


def _dot(first: Array, second: Array) -> Array:
    """Returns the inner products (...) of vectors (..., 2)."""
    return first[..., 0] * second[..., 0] + first[..., 1] * second[..., 1]
