"""`TwistedRope`: start states of the tasks on a rope."""

import dataclasses

from softgym_mj.entities.rope import FIDELITIES, Rope
from softgym_mj.exceptions import SimulationError
from softgym_mj.tasks.shared.starts.settling import (
    SETTLED_SPEED,
    Procedure,
    SettledFlex,
    Settling,
    centered,
)
from softgym_mj.variations.indices import generator

_PLACES = 41  # Number of evenly spaced places at which the rope may be taken.
# Displacement of the dragged vertex per sim step [m] and its duration in sim steps.
_DRAG_DISPLACEMENT, _DRAG_STEPS, _DRAG_REPEATS = 0.005, 60, 4
_SETTLE_STEPS, _FINAL_STEPS = 100, 500
_MAX_STEPS = 3000  # SoftGym stops after its 500 even in motion; we simulate until it rests.


@dataclasses.dataclass(frozen=True)
class TwistedRope(SettledFlex):
    """Rope dragged by a random vertex four times, then settled (docs/softgym.md 3.4)."""

    fidelity: str = "default"
    name: str = "twisted_rope"

    @property
    def parameters(self) -> dict[str, object]:
        """Parameters that determine the states."""
        rope = Rope(self.fidelity).physical_parameters
        return {"version": 4, "fidelity": self.fidelity, "rope": rope}

    @property
    def max_points(self) -> int:
        """Number of vertices."""
        return FIDELITIES[self.fidelity]

    def sizes(self, index: int) -> tuple[()]:
        """Returns no sizes: the rope is the same in every variation."""
        return ()

    def flex(self, index: int) -> Rope:
        """Returns the rope, the same in every variation."""
        return Rope(self.fidelity)

    def begin(self, index, flex):
        return flex.straight()

    def procedure(self, index: int, flex: Rope, scene: Settling) -> Procedure:
        """Drags the rope and waits until it rests."""
        random = generator(self.name, index)
        for repeat in range(_DRAG_REPEATS):
            # Drawn from the default rope's vertices: the same place for every fidelity.
            place = int(random.integers(_PLACES)) / (_PLACES - 1)
            vertex = round(place * (flex.num_points - 1))
            direction = random.uniform([-1.0, -1.0, 0.0], [1.0, 1.0, 2.0])
            yield from scene.drag(vertex, _DRAG_DISPLACEMENT * direction, _DRAG_STEPS)
            last = repeat == _DRAG_REPEATS - 1
            yield from scene.settle(_SETTLE_STEPS + (_FINAL_STEPS if last else 0))
        if scene.max_speed() >= SETTLED_SPEED:
            yield from scene.settle(_MAX_STEPS)
        if scene.max_speed() >= SETTLED_SPEED:
            raise SimulationError(
                f"variation {index} of {self.name} still moves at {scene.max_speed():.3f} m/s "
                f"after {_MAX_STEPS} sim steps"
            )
        return centered(scene.points)
