"""`FlatShirt`: start states of the task on shirts."""

import dataclasses
import functools
import math

import numpy as np

from softgym_mj.entities.shirt import Cut, Shirt, num_vertices
from softgym_mj.tasks.shared.starts.settling import Procedure, SettledFlex, Settling
from softgym_mj.variations.indices import NUM_VARIATIONS, generator

Ranges = dict[str, tuple[float, float]]  # Of measures of a `Cut`; cuffs are shares of armholes.
_SHARED: Ranges = {
    "chest": (0.17, 0.22), "neck": (0.07, 0.085), "neck_front": (0.05, 0.07),
    "shoulder_drop": (0.025, 0.045), "armhole": (0.13, 0.17),
}  # fmt: skip
_BODY: Ranges = {"length": (0.46, 0.58), "flare": (1.0, 1.08), "waist": (0.0, 0.08)}
# Kinds of cuts by name of a category: T-shirts and shirts with long sleeves; dresses.
CUTS: dict[str, tuple[Ranges, ...]] = {
    "usual": (
        {**_BODY, "sleeve": (0.13, 0.2), "sleeve_angle": (0.3, 0.7), "cuff": (0.8, 0.95)},
        {
            **_BODY, "length": (0.5, 0.58),
            "sleeve": (0.33, 0.39), "sleeve_angle": (0.7, 0.9), "cuff": (0.55, 0.7),
        },
    ),
    "unseen": (
        {
            "length": (0.66, 0.74), "flare": (1.35, 1.6), "waist": (0.12, 0.2),
            "sleeve": (0.07, 0.1), "sleeve_angle": (0.3, 0.6), "cuff": (0.85, 1.0),
        },
    ),
}  # fmt: skip
_SHIFT, _ANGLE = 0.03, math.pi / 4  # [m], [rad] Largest shift and rotation from the hem at -X.
_SETTLE_STEPS = 300  # [sim steps]


@dataclasses.dataclass(frozen=True)
class FlatShirt(SettledFlex):
    """Shirt of a random cut that lies flat on its back, rotated about the vertical.

    Attributes:
        fidelity: resolution, as of a `Shirt`.
        cuts: category of cuts, one of `CUTS`.
    """

    fidelity: str = "default"
    cuts: str = "usual"
    name: str = "flat_shirt"

    @property
    def parameters(self) -> dict[str, object]:
        """Parameters that determine the states."""
        shirt = Shirt(fidelity=self.fidelity).physical_parameters
        return {"version": 1, "fidelity": self.fidelity, "cuts": CUTS[self.cuts], "shirt": shirt}

    @property
    def max_points(self) -> int:
        """Largest number of vertices in any variation."""
        return _most_vertices(self)

    def cut(self, index: int) -> Cut:
        """Returns the cut of a variation."""
        random, kinds = generator(f"{self.name}/cut", index), CUTS[self.cuts]
        return _cut(kinds[random.integers(len(kinds))], random)

    def sizes(self, index: int) -> tuple[Cut]:
        """Returns the sizes of the objects: the shirt's cut."""
        return (self.cut(index),)

    def flex(self, index: int) -> Shirt:
        return Shirt(self.cut(index), fidelity=self.fidelity)

    def begin(self, index, flex):
        random = generator(f"{self.name}/place", index)
        angle = random.uniform(-_ANGLE, _ANGLE) - math.pi / 2
        x, y = random.uniform(-_SHIFT, _SHIFT, size=2).tolist()
        return flex.laid((x, y), angle)

    def procedure(self, index: int, flex: Shirt, scene: Settling) -> Procedure:
        """Waits until the shirt rests."""
        yield from scene.settle(_SETTLE_STEPS)
        return scene.points


def _cut(ranges: Ranges, random: np.random.Generator) -> Cut:
    """Returns a cut with random measures."""
    drawn = {name: random.uniform(*ends) for name, ends in {**_SHARED, **ranges}.items()}
    return Cut(**{**drawn, "cuff": drawn["cuff"] * drawn["armhole"]})


@functools.cache
def _most_vertices(start: FlatShirt) -> int:
    cuts = (start.cut(index) for index in range(NUM_VARIATIONS))
    return max(num_vertices(cut, start.fidelity) for cut in cuts)
