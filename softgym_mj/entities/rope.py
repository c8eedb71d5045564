"""`Rope`: a cotton rope, 0.5 m long, as a one-dimensional MuJoCo flex."""

import math

import numpy as np

from softgym_mj.entities.flex import Color, Flex
from softgym_mj.entities.room import add_material
from softgym_mj.exceptions import check_name, check_number
from softgym_mj.native.meshes import ROPE, tube, tube_faces
from softgym_mj.rendering.look import FAST, ROPE_SURFACE, Look
from softgym_mj.rendering.patterns import ROPES
from softgym_mj.rendering.skins import DRAWN_SKINS, SHOWN_FLEXES, still
from softgym_mj.rendering.surfaces import ROPE_SKIN, rope_shape
from softgym_mj.rendering.textures import strands
from softgym_mj.validation import typed
from softgym_mj.variations.randomization import (
    Parameter,
    choice_parameter,
    decode_choice,
    scaled_parameter,
    shifted_parameter,
    tinted,
)

# [m] Natural length. SoftGym counts a rope of this length as straight; its own relaxed rope is 7.5
# % longer.
LENGTH = 0.5
# Number of vertices; SoftGym has 41. Neighbors must be two radii apart, or every second edge of a
# straight rope would collide: the "accurate" rope is thinner, 8.3 mm instead of 12.5 mm.
FIDELITIES = {"fast": 31, "default": 41, "accurate": 61}
NUM_KEY_POINTS = 10
RADIUS = 0.00625  # [m] SoftGym's drawn radius; here it is the contact radius too.
MASS = 0.05  # [kg], 0.1 kg/m: a cotton rope of this diameter.
# [N m^2] Soft cotton rope. With ten times more, a third of the twisted initial states spring back
# to nearly straight.
BEND_STIFFNESS = 1.2e-5
STRETCH_STIFFNESS = 800.0  # [N] It stretches by 0.03 % under its own weight.
STRETCH_DAMPING = 5e-4  # [s]
BEND_DAMPING = 0.01  # [s] With less, one tight knot in a thousand trembles forever.
FRICTION = 1.0  # SoftGym's friction of the rope against shapes and floor.
COLOR = (0.05, 0.25, 0.68, 1.0)  # SoftGym's blue, darker: it stands out from a bright table.

PARAMETERS = (
    scaled_parameter("stretch_stiffness", "N", STRETCH_STIFFNESS, 1.4, 2.0, "force per strain"),
    scaled_parameter("bend_stiffness", "N m^2", BEND_STIFFNESS, 2.0, 5.0, "moment per curvature"),
    scaled_parameter("bend_damping", "s", BEND_DAMPING, 2.0, 5.0, "damping time"),
    scaled_parameter("density", "kg/m", MASS / LENGTH, 1.4, 2.0, "mass per length"),
    scaled_parameter("friction", "", FRICTION, 1.2, 1.6, "friction on the floor and on itself"),
    shifted_parameter("hue", "deg", 20.0, 90.0, "hue rotation of colors", "visual"),
    Parameter("brightness", "", 1.0, (0.75, 1.25), (0.5, 1.45), "factor on colors", "visual"),
    choice_parameter("pattern", ROPES, 2, "pattern of the strands"),
)


class Rope(Flex):
    """A rope; at rest it lies along +X, centered at the origin.

    Attributes:
        key_points: vertex indices (10,), evenly spaced from end to end; SoftGym's are 0, 4, ...,
            32, 40.
    """

    parameters = PARAMETERS
    # Less than a cloth's: in a tangle some pieces stretch by twice as much.
    hold_stretch = 0.03
    hold_force = 30.0  # [N] It stretches the rope by slightly more than `hold_stretch`.
    # [m] The motion of a step and two strands: beyond, the rope is caught in a tangle.
    max_tracking_error = 0.04

    @typed
    def _build(
        self,
        fidelity: str = "default",
        color: Color = COLOR,
        name: str = "rope",
        twist: float = 0.0,
    ):
        """Builds the rope.

        Args:
            fidelity: "fast", "default" or "accurate": 31, 41 or 61 vertices.
            color: (r, g, b, a) in 0..1.
            name: model name.
            twist: twist stiffness, moment per twist [N m^2], at most 1; 0 disables twist, above
                it grips that hold both ends hold their frames, too.

        Raises:
            InvalidArgumentError: if there is no such fidelity or stiffness.
        """
        check_name("fidelity", fidelity, FIDELITIES)
        check_number("twist", twist, ge=0.0, le=1.0)
        count = FIDELITIES[fidelity]
        radius = min(RADIUS, LENGTH / (count - 1) / 2)
        self._color, self._look, self._twist = tuple(color), FAST, twist
        self._start_model(name)
        points = np.zeros((count, 3))
        points[:, 0] = np.linspace(-LENGTH / 2, LENGTH / 2, count)
        elements = np.column_stack([np.arange(count - 1), np.arange(1, count)])
        flexcomp = self._add_flexcomp(points, elements, radius=radius)
        flexcomp.contact.condim = 3
        flexcomp.group = SHOWN_FLEXES
        self._mjcf_root.asset.add("texture", name="strands", type="2d")
        add_material(self._mjcf_root, "rope", ROPE_SURFACE, texture="strands")
        self._set_skin()
        self.key_points = np.round(np.linspace(0, count - 1, NUM_KEY_POINTS)).astype(int)
        self._set_parameters()

    def set_look(self, look: Look) -> None:
        if look != self._look:
            self._look = look
            self._set_skin()
            self._set_parameters()

    def _set_skin(self) -> None:
        shape = rope_shape(self._look)
        vertices, _ = tube(self._rest_points, self.radius, **shape)
        number = len(self._rest_points)
        faces, texcoords = tube_faces(
            number, sides=shape["sides"], rings_per_edge=shape["rings_per_edge"]
        )
        # The texture winds with the strands.
        texcoords[:, 0] -= texcoords[:, 1] * ROPE.twist * LENGTH / (2.0 * math.pi)
        self._mjcf_root.deformable.skin.clear()
        self._mjcf_root.deformable.add(
            "skin", name=ROPE_SKIN, material="rope", group=DRAWN_SKINS,
            file=still(vertices, texcoords, faces),
        )  # fmt: skip

    def _set_parameters(self):
        values = self._values
        flexcomp = self._mjcf_root.worldbody.flexcomp[0]
        flexcomp.mass = values["density"] * LENGTH
        flexcomp.contact.friction = [values["friction"]]
        color = tinted(self._color, values["hue"], brightness=values["brightness"])
        flexcomp.rgba = color
        index, seed = decode_choice(values["pattern"], len(ROPES))
        self._mjcf_root.find("texture", "strands").file = strands(
            self._look, color[:3], ROPE.lobes, ROPES[index], seed
        )
        self._set_material(
            stretch=values["stretch_stiffness"],
            bend=values["bend_stiffness"],
            stretch_damping=STRETCH_DAMPING,
            bend_damping=values["bend_damping"],
            friction=values["friction"],
            twist=self._twist,
        )

    @property
    def ends(self) -> tuple[int, int]:
        """Vertex indices of the two ends."""
        return 0, self.num_points - 1

    def straight(self) -> np.ndarray:
        """Returns vertex positions (num_points, 3) [m] of the straight rope on the floor."""
        return self._rest_points + np.array([0.0, 0.0, self.radius])

    def end_distance(self) -> float:
        """Returns the distance [m] between the two end vertices."""
        first, last = self.ends
        return math.dist(self.vertex(first), self.vertex(last))
