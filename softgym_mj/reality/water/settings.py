"""Liquids and kernels that recordings are compared with, and results."""

import dataclasses

from softgym_mj.fluid.water import Liquid


@dataclasses.dataclass(frozen=True)
class Setting:
    """A liquid and the range of the density kernel."""

    liquid: Liquid
    kernel: str


# Water at 20 C; liquids have no Coulomb friction on a wall.
WATER = Liquid(viscosity=1e-6, friction=0.0)
SETTINGS = {
    "narrow kernel": Setting(WATER, "narrow"),
    "wide kernel": Setting(WATER, "wide"),
}


@dataclasses.dataclass(frozen=True)
class Measurement:
    """An error of a simulation of a recording.

    Attributes:
        experiment: Name of the experiment.
        quantity: What is compared.
        setting: Key of `SETTINGS`.
        layers: Particles over the depth at rest.
        particles: Number of particles.
        error: Relative error.
        bound: Largest accepted absolute value of the error, or None.
        delay: [s] Delay of the release that makes the error smallest, or None: no delay.
    """

    experiment: str
    quantity: str
    setting: str
    layers: int
    particles: int
    error: float
    bound: float | None
    delay: float | None = None

    @property
    def passed(self) -> bool:
        """Whether the error is within its bound, if it has one."""
        return self.bound is None or abs(self.error) <= self.bound
