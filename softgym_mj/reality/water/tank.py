"""`Tank`: water between plane walls, which may move together, with a gate and solid boxes."""

import dataclasses
import math
from collections.abc import Sequence

import mujoco
import numpy as np

from softgym_mj.exceptions import SimulationError
from softgym_mj.fluid.water import TIMESTEP, Liquid
from softgym_mj.native.library import FLUID, load_plugin

_TASK_SPACING = 0.018  # [m] Spacing for which the time step of tasks is chosen.
_HAT = 2.0  # Half width of the weights of a level, in spacings.
_AWAY = 1e3  # [m] Position of an opened gate.
GRAVITY = 9.81  # [m/s^2]
_WALLS = (  # Position over (length, width) and axis-angle of the planes of a tank.
    ((0.0, 0.0), "0 1 0 90"),
    ((1.0, 0.0), "0 1 0 -90"),
    ((0.0, 0.0), "1 0 0 -90"),
    ((0.0, 1.0), "1 0 0 90"),
)


@dataclasses.dataclass(frozen=True)
class Box:
    """A solid box on the bottom: from `low` to `high` (3,) [m]."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]


class Tank:
    """A basin from 0 to `length` along X and to `width` along Y, open above.

    Attributes:
        spacing: Particle spacing [m].
        length, width: Size of the basin [m].
        timestep: Physics step [s]: that of tasks, scaled like a time of fall over a spacing.
    """

    def __init__(
        self,
        length: float,
        block: tuple[int, int, int],
        spacing: float,
        liquid: Liquid,
        *,
        width: float | None = None,
        gate: float | None = None,
        boxes: Sequence[Box] = (),
        kernel: str = "narrow",
    ):
        """Fills a block of `block` particles along X, Y and Z in the corner at the origin.

        Args:
            length: Length of the basin [m].
            block: Numbers of particles.
            spacing: Rest distance of particles [m].
            liquid: Properties of the liquid.
            width: Width of the basin [m]; default: that of the block.
            gate: Position of a wall that faces towards -X [m]; `settle` opens it.
            boxes: Solids.
            kernel: Range of the density kernel, an attribute of the plugin.
        """
        load_plugin()
        self.spacing = spacing
        self.timestep = TIMESTEP * math.sqrt(spacing / _TASK_SPACING)
        self.length = length
        self.width = width = block[1] * spacing if width is None else width
        settings = {
            **dataclasses.asdict(liquid),
            "count": math.prod(block),
            "spacing": spacing,
            "columns": f"{block[0]} {block[1]}",
            "corner": " ".join([str(spacing / 2)] * 3),
            "max_speed": 100,
            "draw": "none",
            "kernel": kernel,
        }
        configs = "".join(f'<config key="{k}" value="{v}"/>' for k, v in settings.items())
        planes = "".join(
            f'<geom type="plane" size="1 1 1" pos="{x * length} {y * width} 0" axisangle="{turn}"/>'
            for (x, y), turn in _WALLS
        )
        solids = ""
        for box in boxes:
            low, high = np.array(box.low), np.array(box.high)
            middle, half = (low + high) / 2, (high - low) / 2
            solids += '<geom type="box" pos="{} {} {}" size="{} {} {}"/>'.format(*middle, *half)
        door = (
            f'<body name="gate" mocap="true" pos="{gate} 0 0"><geom type="plane" size="1 1 1" '
            'axisangle="0 1 0 -90"/><plugin instance="water"/></body>'
        )
        self.model = mujoco.MjModel.from_xml_string(
            '<mujoco><compiler angle="degree"/>'
            f'<option timestep="{self.timestep}" gravity="0 0 {-GRAVITY}"/>'
            f'<extension><plugin plugin="{FLUID}"><instance name="water">{configs}</instance>'
            '</plugin></extension><worldbody><body name="tank" mocap="true">'
            f'<geom type="plane" size="1 1 1"/>{planes}{solids}<plugin instance="water"/></body>'
            f"{'' if gate is None else door}</worldbody></mujoco>"
        )
        self.data = mujoco.MjData(self.model)
        size = 3 * math.prod(block)
        state = self.data.plugin_state[1 : 1 + 2 * size]
        self._positions, self._velocities = state.reshape(2, -1, 3)

    @property
    def positions(self) -> np.ndarray:
        """View of the positions (n, 3) of the particles [m], relative to the world."""
        return self._positions

    @property
    def velocities(self) -> np.ndarray:
        """View of the velocities (n, 3) of the particles [m/s]."""
        return self._velocities

    def step(self, offset: float = 0.0) -> None:
        """Steps while the tank moves to X = `offset` [m].

        Raises:
            SimulationError: If the simulation diverges.
        """
        self.data.mocap_pos[0, 0] = offset
        mujoco.mj_step(self.model, self.data)
        if self.data.warning[mujoco.mjtWarning.mjWARN_BADQPOS].number:
            raise SimulationError("the water diverged")

    def settle(self, duration: float) -> None:
        """Lets the water come to rest for a time [s], opens the gate, and sets the clock to 0."""
        for _ in range(round(duration / self.timestep)):
            self.step()
        self._velocities[:] = 0.0
        self.data.mocap_pos[1:, 0] = _AWAY
        self.data.time = 0.0
        self.data.plugin_state[0] = 0.0  # Walls count as at rest at their new poses,
        mujoco.mj_forward(self.model, self.data)  # which this stores.

    def level(self, x: float, y: float | None = None) -> float:
        """Returns the height of the water [m] at a point of the basin, or across its width at `x`.

        It is the volume of particles per area, weighted by hats of two spacings to each side.
        """
        weights = self._hat(self._positions[:, 0] - self.data.mocap_pos[0, 0], x, self.length)
        across = 1 / self.width if y is None else self._hat(self._positions[:, 1], y, self.width)
        return float((weights * across).sum() * self.spacing**3)

    def _hat(self, at: np.ndarray, middle: float, size: float) -> np.ndarray:
        """Returns weights [1/m] of coordinates, whose integral from 0 to `size` is 1."""
        radius = _HAT * self.spacing
        outside = sum(max(1 - d / radius, 0.0) ** 2 / 2 for d in (middle, size - middle))
        return np.maximum(1 - np.abs(at - middle) / radius, 0.0) / (radius * (1 - outside))
