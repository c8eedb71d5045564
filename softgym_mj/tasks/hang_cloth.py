"""The task HangCloth: a towel over a bar, beyond SoftGym."""

from collections.abc import Mapping
from typing import NamedTuple, Unpack

import numpy as np

from softgym_mj import metrics
from softgym_mj.entities.cloth import Cloth
from softgym_mj.exceptions import check_name
from softgym_mj.metrics import Array, Measures
from softgym_mj.robots.workspace import Workspace
from softgym_mj.tasks.shared import entries
from softgym_mj.tasks.shared.base import Task
from softgym_mj.tasks.shared.entries import Entries
from softgym_mj.tasks.shared.guidance import guided
from softgym_mj.tasks.shared.settings import ClothTaskSettings
from softgym_mj.tasks.shared.starts.cloths import FlatTowel
from softgym_mj.tasks.shared.state import Episode, State
from softgym_mj.tasks.shared.symmetry import mirrored
from softgym_mj.variations.indices import generator

# Lowest and highest bars [m], and smallest and largest radii [m], by name of a category.
BARS = {
    "usual": ((0.3, 0.38), (0.008, 0.016)),
    "unseen": ((0.4, 0.46), (0.02, 0.03)),
}
BAR_X, HALF_LENGTH = 0.1, 0.36  # [m] X of the bar, along Y, and half the distance of its posts.
POST = 0.012  # [m] Radius of the posts.
FRICTION = 0.4  # Cotton on smooth wood; MuJoCo's 1 would hold a towel that hangs by an edge.
RESTING, CLEAR = 0.01, 0.02  # [m] Heights of cloth on the floor (at rest: 5 mm) and clear of it.
MARGIN = 0.01  # [m] Largest distance from the bar of cloth that lies on it; half a cloth is 5 mm.
WOOD = (0.55, 0.36, 0.2, 1.0)


class HangCloth(Task):
    """Hang a towel evenly over a bar.

    Goal: one half of the towel hangs on each side of a bar along Y at X = 0.1 m, spread to its
    width, and nothing touches the floor.
    Actions: per picker dx, dy, dz (1 is 0.01 m per sim step) and grip (closes if > 0), each in [-1,
    1].
    Observations: `reduced` (default) lists corners p1 p2 p3 p4, the top of the bar and picker 0,
    picker 1 (x, y, z each): 21 entries [m]. `OBSERVATIONS` of `tasks.shared.observations` lists the
    others.
    Reward = p + (1 - p) a / 2. Performance p: twice the share of the towel that hangs on the side
    of the bar where less of it hangs, times its spread. Cloth on the floor, above the bar or not
    between the posts does not hang. Spread: the standard deviation of the towel along the bar,
    relative to that of its width when flat, at most 1. Approach a = 1 - |u| / |u at the start|: u
    is the mean signed distance of the towel from the top of the bar. Distances of cloth beyond the
    bar are positive if the towel passes over it; all others are negative.
    Bounds: lower = 0 (the start), upper = 1 (both halves hang, spread).
    Horizon: 100 env steps of 8 sim steps; nothing else ends an episode.
    Start: the towel, 0.36 to 0.5 m by 0.24 to 0.34 m, lies flat beside the bar, rotated by up to 10
    degrees. The bar is 0.3 to 0.38 m high, with a radius of 8 to 16 mm; with `bars="unseen"` 0.4 to
    0.46 m and 20 to 30 mm.
    """

    summary = "Hang a towel evenly over a bar."
    difficulty, material = "medium", "cloth"
    horizon = 100
    success = 0.8  # 40 % of the towel on the side where less of it hangs, if it is spread.
    workspace = Workspace((-0.7, -0.6, 0.0), (0.7, 0.6, 0.8))
    view = "hang_cloth"
    symmetries = mirrored("rows")

    def __init__(
        self,
        *,
        fidelity: str = "default",
        bars: str = "usual",
        **settings: Unpack[ClothTaskSettings],
    ):
        """Builds the task.

        Args:
            fidelity: resolution of the cloth: "fast", "default" or "accurate".
            bars: heights and radii of bars: "usual", or "unseen", which are higher and thicker, to
                measure generalization.
            **settings: entries of `ClothTaskSettings`;
                `help("softgym_mj.tasks.shared.settings")` explains them.
        """
        check_name("bars", bars, BARS)
        self._bars = bars
        self.cloth = Cloth(fidelity=fidelity)
        super().__init__([self.cloth], FlatTowel(fidelity, end_x=BAR_X), **settings)
        add, look = self.root_entity.add_solid, {"friction": [FRICTION], "rgba": WOOD}
        self._bar = add("capsule", name="bar", size=[POST], **look)
        self._posts = [
            add("cylinder", name=f"post_{i}", pos=[BAR_X, y, 0.1], size=[POST, 0.1], **look)
            for i, y in enumerate((-HALF_LENGTH, HALF_LENGTH))
        ]
        self._size = (0.0, 0.0)
        self.resize(0)

    def bar(self, variation: int) -> tuple[float, float]:
        """Returns the height of the bar's axis and its radius [m] in a variation."""
        random = generator("hang_cloth/bar", variation)
        height, radius = (float(random.uniform(*ends)) for ends in BARS[self._bars])
        return height, radius

    def resize(self, variation: int) -> bool:
        resized, size = super().resize(variation), self.bar(variation)
        if size == self._size:
            return resized
        height, radius = self._size = size
        self._bar.fromto = [BAR_X, -HALF_LENGTH, height, BAR_X, HALF_LENGTH, height]
        self._bar.size = [radius]
        for post in self._posts:
            post.pos, post.size = [*post.pos[:2], height / 2], [POST, height / 2]
        return True

    def goal(self, variation: int, points: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Returns X, Z and radius "bar" (3,) of the bar, and two lengths () [m].

        "start" is the `passage` at the start, and "spread" the `deviation` of the flat towel.
        """
        bar = np.array([BAR_X, *self.bar(variation)])
        start, flat = (
            across(self.cloth.arrays, vertices, bar)
            for vertices in (points["cloth"], self.cloth.flat())
        )
        return {"bar": bar, "start": passage(start, bar), "spread": deviation(flat)}

    def measure(self, state: State, episode: Episode) -> Measures:
        points, bar = state.points["cloth"], episode.goal["bar"]
        particles = across(episode.shapes["cloth"], points, bar)
        near, far = hanging(particles, bar)
        xp = metrics.namespace(points)
        spread = xp.clip(deviation(particles) / episode.goal["spread"], 0.0, 1.0)
        performance = 2.0 * spread * xp.minimum(near, far)
        away = passage(particles, bar) / episode.goal["start"]
        info = {"hanging_near": near, "hanging_far": far, "spread": spread}
        return guided("hanging", performance, 1.0 - abs(away), info)

    def reduced(self, state: State, episode: Episode) -> Entries:
        return entries.corners(state, episode) | _top(episode)

    def key_points(self, state: State, episode: Episode) -> Entries:
        return entries.key_points(state, episode) | _top(episode)


def _top(episode: Episode) -> dict[str, entries.Entry]:
    """Returns the top of the bar."""
    x, z, radius = (episode.goal["bar"][..., i] for i in range(3))
    top = metrics.columns(x, 0.0 * x, z + radius)
    return {"top of the bar": entries.point(top, "goal")}


class Across(NamedTuple):
    """Particles of a cloth near a bar.

    Attributes:
        aside: X (..., n) from the bar [m].
        along: Y (..., n) along the bar, from its middle [m].
        height: Z (..., n) [m].
        counts: weights (..., n).
    """

    aside: Array
    along: Array
    height: Array
    counts: Array

    @property
    def between(self) -> Array:
        """Whether a particle is between the posts (..., n)."""
        return abs(self.along) < HALF_LENGTH


def across(shape: Mapping[str, Array], points: Array, bar: Array) -> Across:
    """Returns the particles of a cloth.

    Args:
        shape, points: as in `metrics.particles`.
        bar: as in `hanging`.
    """
    sheet = metrics.particles(shape, points)
    aside = metrics.flat(sheet[..., 0]) - bar[..., 0, None]
    along, height = (metrics.flat(sheet[..., i]) for i in (1, 2))
    return Across(aside, along, height, metrics.particle_counts(shape))


def deviation(particles: Across) -> Array:
    """Returns the standard deviation (...) [m] of a cloth along a bar."""
    along, counts = particles.along, particles.counts
    away = along - metrics.mean(along, counts)[..., None]
    return metrics.namespace(along).sqrt(metrics.mean(away**2, counts))


def hanging(particles: Across, bar: Array) -> tuple[Array, Array]:
    """Returns the shares (...) of a cloth that hang on the sides of a bar along Y: -X and +X.

    A particle hangs if it is between the posts, clear of the floor and not above the bar; on top of
    the bar it counts half on each side. Both shares are 0 unless a particle lies on the bar.

    Args:
        particles: of the cloth.
        bar: (..., 3) X, Z and radius [m].
    """
    aside, _, height, counts = particles
    between = particles.between
    z, radius, xp = bar[..., 1, None], bar[..., 2, None], metrics.namespace(height)
    top = z + radius + MARGIN
    lies = (xp.abs(aside) < radius) & (height > z) & (height < top) & between & (counts > 0.0)
    lies = xp.astype(xp.any(lies, axis=-1), xp.float64)
    hangs = xp.clip((height - RESTING) / (CLEAR - RESTING), 0.0, 1.0) * ((height < top) & between)
    side = xp.clip(0.5 + aside / (2 * MARGIN), 0.0, 1.0)
    near, far = (metrics.mean(hangs * part, counts) for part in (1.0 - side, side))
    return lies * near, lies * far


def passage(particles: Across, bar: Array) -> Array:
    """Returns how far (...) [m] a cloth has passed over a bar: 0 if it lies evenly on it.

    It is the mean distance of the particles from the top of the bar, in a plane across the bar.
    Distances of particles beyond the bar are positive if some particle is above the bar, as in a
    cloth that passes over it; all others are negative.

    Args:
        particles, bar: as in `hanging`.
    """
    aside, _, height, counts = particles
    z, radius, xp = bar[..., 1, None], bar[..., 2, None], metrics.namespace(height)
    over = (xp.abs(aside) < radius) & (height > z) & particles.between & (counts > 0.0)
    beyond = (aside > 0.0) & xp.any(over, axis=-1)[..., None]
    distances = xp.sqrt(aside**2 + (height - z - radius) ** 2)
    return metrics.mean(xp.where(beyond, distances, -distances), counts)
