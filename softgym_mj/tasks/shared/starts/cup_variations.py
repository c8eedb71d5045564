"""Variations of the water tasks: amounts of water, and cups that fit (docs/softgym.md 3.0 to 3.2).

SoftGym seeds dx * dz columns of dy particles and derives the cups from these counts. Its fluid is
compressible; ours has the volume of that seed, N r^3 / 2, whatever the number of particles.
"""

import abc
import dataclasses
import math

import numpy as np

from softgym_mj.entities.cup import CupSize
from softgym_mj.exceptions import check_name
from softgym_mj.fluid import Resolution
from softgym_mj.variations.indices import generator

# Particles of a sample as a fraction of SoftGym's.
FIDELITIES = {"fast": 0.5, "default": 1.0, "accurate": 2.0}

_MIN_SIDE, _MAX_SIDE = 4, 13  # Columns along a side.
LARGEST_COUNT = _MAX_SIDE * _MAX_SIDE * 4 * _MAX_SIDE  # 8788 particles.

WALL = 0.045  # [m] Wall of the cup that is moved; also the term of its height.
TARGET_WALL = 0.03  # [m]
MIN_GAP = 0.02  # [m] Cups that are closer could be stuck from the start: such draws are repeated.


def num_particles(count: int, fidelity: str) -> int:
    """Returns the number of particles that represents `count` of SoftGym's."""
    check_name("fidelity", fidelity, FIDELITIES)
    return round(FIDELITIES[fidelity] * count)


@dataclasses.dataclass(frozen=True)
class Sample:
    """SoftGym's sample of water: dx * dz columns of dy particles."""

    dx: int
    dy: int
    dz: int

    @classmethod
    def draw(cls, random: np.random.Generator) -> "Sample":
        """Draws a sample: dx, dz uniform in 4..13; half are "medium", half "large"."""
        dx, dz = random.integers(_MIN_SIDE, _MAX_SIDE + 1, size=2).tolist()
        smaller = min(dx, dz)
        return cls(dx, 4 * smaller if random.random() < 0.5 else int(3.5 * smaller), dz)

    @property
    def smaller(self) -> int:
        """Smaller of dx and dz, q in docs/softgym.md 3.0."""
        return min(self.dx, self.dz)

    @property
    def is_large(self) -> bool:
        """Whether the sample is SoftGym's "large" amount of water, which gets a flatter cup."""
        return self.dy == 4 * self.smaller

    @property
    def count(self) -> int:
        """Number of particles in SoftGym."""
        return self.dx * self.dy * self.dz

    def column(self, rest_distance: float) -> float:
        """Returns the height [m] of particles stacked `rest_distance` [m] apart.

        It is h in docs/softgym.md.
        """
        return self.count * rest_distance / ((self.dx + 1) * (self.dz + 1))


@dataclasses.dataclass(frozen=True)
class CupVariation:
    """Water and cups of a variation.

    Attributes:
        sample: amount of water.
        rest_distance: SoftGym's r [m].
        cup: cup that holds the water, upright at x = z = 0.
        target: cup to pour into, None if there is none.
        distance: distance of the two cups' middles along X [m].
    """

    sample: Sample
    rest_distance: float
    cup: CupSize
    target: CupSize | None = None
    distance: float = 0.0

    @property
    def volume(self) -> float:
        """Volume of the water [m^3]."""
        return self.sample.count * self.rest_distance**3 / 2

    @property
    def cups(self) -> tuple[CupSize, ...]:
        """All cups, starting with the one that holds the water."""
        return (self.cup,) if self.target is None else (self.cup, self.target)

    @property
    def places(self) -> tuple[float, ...]:
        """X [m] of the cups' middles at the start."""
        return (0.0, self.distance)[: len(self.cups)]

    @property
    def gap(self) -> float:
        """Gap between the outer walls of the two cups [m]; infinite if there is one cup."""
        if self.target is None:
            return np.inf
        return self.distance - sum(size.length / 2 + size.wall for size in self.cups)

    def resolution(self, fidelity: str) -> Resolution:
        """Returns particles of this volume, in as many columns as fit on the cup's floor."""
        count = num_particles(self.sample.count, fidelity)
        spacing = math.cbrt(self.volume / count)
        columns = round(self.cup.length / spacing), round(self.cup.width / spacing)
        return Resolution(count, spacing, columns)


class CupVariations(abc.ABC):
    """Family of variations; picklable."""

    name: str

    def variation(self, index: int) -> CupVariation:
        """Returns a variation: a pure function of the family's name and the index."""
        random = generator(self.name, index)
        variation = self._draw(random)
        while variation.gap < MIN_GAP:
            variation = self._draw(random)
        return variation

    @abc.abstractmethod
    def _draw(self, random: np.random.Generator) -> CupVariation:
        """Draws a variation."""


@dataclasses.dataclass(frozen=True)
class TransportCups(CupVariations):
    """Variations of one cup (docs/softgym.md 3.1)."""

    name: str = "transport_water"

    def _draw(self, random):
        return transport_variation(Sample.draw(random))


@dataclasses.dataclass(frozen=True)
class PourCups(CupVariations):
    """Variations of a cup to pour from and one to pour into (docs/softgym.md 3.2)."""

    name: str = "pour_water"

    def _draw(self, random):
        return pour_variation(Sample.draw(random), *random.random(3).tolist())


def transport_variation(sample: Sample) -> CupVariation:
    """Returns the variation of a sample with one cup (docs/softgym.md 3.1)."""
    r = 0.015  # [m]
    column = sample.column(r)
    inner = column / 3 + 0.0015 * sample.smaller if sample.is_large else column / 2
    cup = CupSize((sample.dx + 4) * r, (sample.dz + 4) * r, inner + WALL, WALL)
    return CupVariation(sample, r, cup)


def pour_variation(sample: Sample, height: float, extra: float, way: float) -> CupVariation:
    """Returns the variation of a sample with two cups (docs/softgym.md 3.2).

    Args:
        sample: amount of water.
        height, extra, way: uniform random numbers in [0, 1) for the cup's height, the target's
            additional height and its distance.
    """
    r = 0.033 * 0.55  # [m]
    column, q = sample.column(r), sample.smaller
    if sample.is_large:
        inner = column / 3 + 0.001 * (q + height)
    else:
        inner = column / 2 + 0.001 * (height - 0.5)
    length, width = sample.dx * r, sample.dz * r
    cup = CupSize(length + 0.1, width + 0.1, inner + WALL, WALL)
    target = CupSize(length + 0.07, width + 0.07, cup.height + 0.1 * extra, TARGET_WALL)
    distance = q * (0.05 + 0.04 * way) + (sample.dx + 4) * r / 2
    return CupVariation(sample, r, cup, target, distance)
