"""`Sheet`: a two-dimensional flex with two colored sides, the base of `Cloth` and `Garment`."""

import abc
import math

import numpy as np
from scipy import sparse

from softgym_mj.entities.fabric import Fabric, solver_material
from softgym_mj.entities.flex import FLEX, Color, Flex
from softgym_mj.entities.intersections import count_intersections
from softgym_mj.entities.room import add_material
from softgym_mj.native.arithmetic import product
from softgym_mj.rendering.look import FABRIC, FAST, Look
from softgym_mj.rendering.patterns import FABRICS
from softgym_mj.rendering.skins import HIDDEN_FLEXES, SkinFile, closed
from softgym_mj.rendering.textures import weave
from softgym_mj.variations.randomization import decode_choice, tinted

FRONT_COLOR = (0.80, 0.14, 0.33, 1.0)  # Raspberry and cream: the contrast of SoftGym's
BACK_COLOR = (0.93, 0.79, 0.56, 1.0)  # pink and orange, in hue and in lightness.
SKIN_OFFSET = 0.0015  # [m] Distance of each rendered side from the mid-surface.


class Sheet(Flex):
    """Triangles that stretch and bend, rendered as a closed skin with two sides.

    Attributes:
        triangles: vertex indices (num_triangles, 3).
    """

    def _start_sheet(
        self,
        name: str,
        fabric: Fabric | None,
        colors: tuple[Color, Color] = (FRONT_COLOR, BACK_COLOR),
        has_strip: bool = False,
    ) -> None:
        """Starts the model; to be called first in a subclass's `_build`.

        Args:
            name: model name.
            fabric: fabric; None for a woven tablecloth.
            colors: (r, g, b, a) in 0..1 of the front and the back.
            has_strip: whether a strip has the other side's color.
        """
        self._colors, self._has_strip, self._look = colors, has_strip, FAST
        self.parameters = (Fabric() if fabric is None else fabric).parameters
        self._start_model(name)
        self._mjcf_root.asset.add("texture", name="weave", type="2d")
        add_material(self._mjcf_root, "fabric", FABRIC, texture="weave")

    def set_look(self, look: Look) -> None:
        if look != self._look:
            self._look = look
            self._set_skin()
            self._set_parameters()

    def intersections(self) -> int:
        """Returns the number of self-intersections of the sheet (takes some milliseconds)."""
        return count_intersections(self.points(), self.edges, self.triangles)

    def _set_mesh(self, points: np.ndarray, triangles: np.ndarray) -> None:
        """Replaces the mesh by `points` (n, 3) [m] and `triangles` (m, 3)."""
        self.triangles = triangles
        radius, rgba = self._values["thickness"] / 2.0, self._colors[0]
        flexcomp = self._add_flexcomp(points, triangles, radius=radius, rgba=rgba)
        flexcomp.contact.condim = 3
        flexcomp.group = HIDDEN_FLEXES  # The skin is rendered instead.
        self._set_skin()
        self._set_parameters()

    def _set_skin(self) -> None:
        skin = self._skin(self._look.refinement)
        if skin is None:
            return
        weights, faces, texcoords = skin
        # The right half of the texture is the other side's.
        sides = np.vstack([texcoords, texcoords + [1.0, 0.0]]) * [0.5, 1.0]
        points = weights @ self._rest_points
        file = SkinFile(
            np.vstack([points, points]), sides, closed(faces, len(points)),
            sparse.vstack([weights, weights]), self._rest_points, self._vertex_bodies,
        )  # fmt: skip
        self._mjcf_root.deformable.skin.clear()
        self._mjcf_root.deformable.add(
            "skin", name="skin", material="fabric", inflate=SKIN_OFFSET, file=file
        )

    def _vertex_bodies(self) -> list[str]:
        prefix = self._mjcf_root.full_identifier
        return [f"{prefix}{FLEX}_{vertex}" for vertex in range(self.num_points)]

    def _set_parameters(self):
        values = self._values
        flexcomp = self._mjcf_root.worldbody.flexcomp[0]
        flexcomp.mass = self._mass(values["density"])
        flexcomp.radius = self.radius = values["thickness"] / 2.0
        flexcomp.contact.friction = [values["friction"]]
        self._set_material(**solver_material(values))
        front, back = (
            tinted(color[:3], values["hue"], brightness=values["brightness"])
            for color in self._colors
        )
        index, seed = decode_choice(values["pattern"], len(FABRICS))
        self._mjcf_root.find("texture", "weave").file = weave(
            self._look, (front, back), self._has_strip, FABRICS[index], seed
        )

    @abc.abstractmethod
    def _mass(self, density: float) -> float:
        """Returns the mass [kg] of the sheet for a mass per area [kg/m^2]."""

    @abc.abstractmethod
    def _skin(self, refinement: int) -> tuple[sparse.csr_array, np.ndarray, np.ndarray] | None:
        """Returns the rendered mesh, with edges `refinement` times shorter than those of the flex.

        Returns:
            Weights (n, num_points) of flex vertices in rendered vertices, triangles (m, 3)
            counter-clockwise from the front, texture coordinates (n, 2) in 0..1; None for a sheet
            that is not rendered.
        """

    def _turned(self, points: np.ndarray, center: tuple[float, float], angle: float) -> np.ndarray:
        """Returns points (n, 3) [m] rotated about +Z by an angle [rad] and moved onto the floor.

        The origin goes to `center` (X, Y) [m], at the resting height.
        """
        cosine, sine = math.cos(angle), math.sin(angle)
        turn = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return product(points, turn) + [*center, self.radius]
