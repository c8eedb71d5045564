"""`Water`: a particle liquid, simulated by the engine plugin softgym_mj.fluid."""

import dataclasses

import mujoco
import numpy as np
from dm_control import composer, mjcf

from softgym_mj.exceptions import (
    InvalidArgumentError,
    check_count,
    check_number,
    set_by_compile,
)
from softgym_mj.native.library import FLUID, load_plugin
from softgym_mj.rendering.look import FAST, WATER, Look
from softgym_mj.rendering.skins import DRAWN_SKINS, loose_triangles
from softgym_mj.rendering.surfaces import PARTICLES, WATER_INSTANCE, WATER_SKIN
from softgym_mj.validation import as_finite, typed
from softgym_mj.variations.parametric import Parametric
from softgym_mj.variations.randomization import (
    Parameter,
    scaled_parameter,
    shifted_parameter,
    tinted,
)

TIMESTEP = 0.01  # [s] A sim step; deeper water has more substeps.
MOST_PARTICLES = 200_000  # Limit of the plugin: a step of this many takes about 0.1 s.
LARGEST = 1e4  # [m], [m/s] Single precision resolves a millimeter up to here.


@typed
@dataclasses.dataclass(frozen=True)
class Liquid:
    """Properties of the liquid.

    Attributes:
        viscosity: Kinematic viscosity [m^2/s].
        cohesion: Attraction of particles [m/s^2].
        friction: Friction coefficient with walls.
        density: Density [kg/m^3].
    """

    viscosity: float
    cohesion: float = 0.0
    friction: float = 0.01  # Value of SoftGym.
    density: float = 1000.0


@typed
@dataclasses.dataclass(frozen=True)
class Resolution:
    """Number and size of particles.

    Attributes:
        count: Number of particles.
        spacing: Rest distance [m]; a particle represents a volume of spacing^3.
        columns: Particles along X and Y of the water at rest; with `count` they determine its
            depth and the number of substeps.
    """

    count: int
    spacing: float
    columns: tuple[int, int]

    def __post_init__(self):
        for number in (self.count, *self.columns):
            check_count("count, columns", number, 1, MOST_PARTICLES)
        check_number("spacing", self.spacing, gt=0.0)


class Water(composer.Entity, Parametric):
    """Water in the world frame; `confine` makes bodies its walls.

    Positions and velocities are plugin state and thus part of mjSTATE_INTEGRATION. `mj_step`
    advances them at its end, from the walls' poses of the last step to the current ones.

    Attributes:
        parameters: Domain parameters of the liquid and its color.
        arrays: Size-dependent arrays for measures, by name: none.
        timestep: Physics step [s].
        state: Views of the plugin state by name: "known" (1,), 1 once the last poses of the walls
            are stored; "positions", "velocities" (num_points, 3) [m], [m/s]; "rest", which begins
            with these poses (walls, 7) unless cloth or ropes are walls, too.
    """

    timestep = TIMESTEP
    state: dict[str, np.ndarray] = set_by_compile()
    _positions: np.ndarray = set_by_compile()
    _velocities: np.ndarray = set_by_compile()
    _motion: np.ndarray = set_by_compile()

    @typed
    def _build(
        self,
        liquid: Liquid,
        resolution: Resolution,
        two_way: bool = False,
        flexes: bool = False,
        name: str = "water",
    ):
        """Builds the water and loads the plugin.

        Args:
            liquid: Properties of the liquid.
            resolution: Number and size of particles.
            two_way: Whether the water exerts forces on bodies with joints.
            flexes: Whether cloth and ropes are walls of the water; it exerts no forces on them.
            name: Model name.
        """
        load_plugin()
        self.parameters = (
            scaled_parameter(
                "viscosity", "m^2/s", liquid.viscosity, 2.0, 5.0, "kinematic viscosity"
            ),
            scaled_parameter(
                "cohesion", "m/s^2", liquid.cohesion, 1.4, 2.0, "attraction of particles"
            ),
            scaled_parameter(
                "wall_friction", "", liquid.friction, 2.0, 5.0, "friction on the walls of cups"
            ),
            shifted_parameter("hue", "deg", 20.0, 90.0, "hue rotation of colors", "visual"),
            Parameter(
                "opacity",
                "",
                WATER.rgba[3],
                (0.4, 0.65),
                (0.2, 0.9),
                "opacity of its surface",
                "visual",
            ),
        )
        self.arrays: dict[str, np.ndarray] = {}
        self._liquid, self._resolution = liquid, resolution
        self._mjcf_root = mjcf.RootElement(model=name)
        self._mjcf_root.option.timestep = TIMESTEP
        plugin = self._mjcf_root.extension.add("plugin", plugin=FLUID)
        self._instance = plugin.add("instance", name=WATER_INSTANCE)
        for key, value in dataclasses.asdict(liquid).items():
            self._configure(key, value)
        self._configure("two_way", str(two_way).lower())
        self._configure("flexes", str(flexes).lower())
        self._material = self._mjcf_root.asset.add(
            "material", name="water", specular=WATER.specular, shininess=WATER.shininess
        )
        self._set_color(0.0, WATER.rgba[3])
        self._numbers = self._mjcf_root.custom.add("numeric", name=PARTICLES, data=[0.0] * 2)
        self._set_resolution(resolution)
        self.set_look(FAST)

    def set_look(self, look: Look) -> None:
        """Sets its appearance before compilation."""
        skins = self._mjcf_root.deformable
        skins.skin.clear()
        skins.add(
            "skin", name=WATER_SKIN, material="water", group=DRAWN_SKINS,
            file=loose_triangles(look.water_triangles),
        )  # fmt: skip

    def _set_color(self, hue: float, opacity: float) -> None:
        self._material.rgba = [*tinted(WATER.rgba[:3], hue), opacity]
        self._configure("rgba", *self._material.rgba)  # For viewers that do not update the skin.

    def _set_parameters(self) -> None:
        values = self._values
        self._configure("viscosity", values["viscosity"])
        self._configure("cohesion", values["cohesion"])
        self._configure("friction", values["wall_friction"])
        self._set_color(values["hue"], values["opacity"])

    def _configure(self, key: str, *values):
        text = " ".join(str(value) for value in values)
        for config in self._instance.config:
            if config.key == key:
                config.value = text
                return
        self._instance.add("config", key=key, value=text)

    def _set_resolution(self, resolution: Resolution):
        self._resolution = resolution
        self._configure("count", resolution.count)
        self._configure("spacing", resolution.spacing)
        self._numbers.data = [resolution.count, resolution.spacing]
        self._configure("columns", *resolution.columns)

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """Its MJCF."""
        return self._mjcf_root

    @property
    def num_points(self) -> int:
        """Number of particles."""
        return self._resolution.count

    @property
    def spacing(self) -> float:
        """Rest distance [m]; a particle represents a volume of spacing^3."""
        return self._resolution.spacing

    @property
    def physical_parameters(self) -> dict[str, float]:
        """Properties of the liquid."""
        return {**dataclasses.asdict(self._liquid), "timestep": TIMESTEP}

    def resize(self, resolution: Resolution) -> bool:
        """Sets the particles; returns True if the model changed and must be recompiled."""
        if resolution == self._resolution:
            return False
        self._set_resolution(resolution)
        return True

    def confine(self, *bodies: mjcf.Element) -> None:
        """Makes the geoms of bodies walls of the water, whatever else they collide with.

        Call it once the water and the bodies are attached to the same scene. Colliding geoms that
        are fixed to the world, such as the floor, are always walls.

        Args:
            *bodies: MJCF elements `body` of that scene, with joints, as mocap body or fixed.

        Raises:
            InvalidArgumentError: If an argument is anything else.
        """
        for body in bodies:
            if not isinstance(body, mjcf.Element) or body.tag != "body":
                valid = "MJCF elements `body`, such as `cup.body` or `worldbody.add('body')`"
                raise InvalidArgumentError("bodies", body, valid)
            if body.root.root_model is not self._mjcf_root.root_model:
                valid = "bodies of the scene that the water has been attached to"
                raise InvalidArgumentError("bodies", body.full_identifier, valid)
            body.add("plugin", plugin=FLUID, instance=self._instance)

    # ------------------------------------------------------------------ simulation

    def after_compile(self, physics, random_state):
        model, data = physics.model.ptr, physics.data.ptr
        name = f"{self._mjcf_root.model}/{WATER_INSTANCE}"
        instance = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_PLUGIN, name)
        first, size = model.plugin_stateadr[instance], 3 * self.num_points
        state = data.plugin_state[first : first + model.plugin_statenum[instance]]
        self._known, positions, velocities, rest = np.split(state, [1, 1 + size, 1 + 2 * size])
        self._positions, self._velocities = positions.reshape(-1, 3), velocities.reshape(-1, 3)
        self._motion = state[1 : 1 + 2 * size]
        self.state = {
            "known": self._known,
            "positions": self._positions,
            "velocities": self._velocities,
            "rest": rest,
        }

    @property
    def motion(self) -> np.ndarray:
        """View of positions, then velocities (6 * num_points,)."""
        return self._motion

    def points(self) -> np.ndarray:
        """Returns a copy of the positions (num_points, 3) [m] in the world frame."""
        return self._positions.copy()

    def velocities(self) -> np.ndarray:
        """Returns a copy of the velocities (num_points, 3) [m/s]."""
        return self._velocities.copy()

    def set_points(self, positions: np.ndarray, velocities: np.ndarray | float = 0.0) -> None:
        """Places the particles: `positions` (num_points, 3) [m], `velocities` alike [m/s].

        This also resets the motion of the walls: they may be teleported with the water before the
        next `mj_forward` or step, which stores their poses.

        Raises:
            InvalidArgumentError: If a shape is wrong, or a number is not finite or beyond
                +-10 km (km/s).
        """
        shape = (self.num_points, 3)
        positions = as_finite("positions", positions, shape, most=LARGEST)
        self._velocities[:] = as_finite("velocities", velocities, shape, (), most=LARGEST)
        self._positions[:] = positions
        self._known[:] = 0.0
