"""Surfaces of ropes and water, recomputed for every image."""

import abc

import mujoco
import numpy as np

from softgym_mj.native.meshes import MOST_TRIANGLES, PLAIN, ROPE, Mesh, tube, water_mesh
from softgym_mj.rendering.look import Look
from softgym_mj.rendering.skins import DRAWN_SKINS

# Names of skin and flex in the model of a rope; and of skin, plugin instance, number of particles
# and rest distance [m] in the model of water.
ROPE_SKIN, ROPE_FLEX = "rope_surface", "flex"
WATER_SKIN, WATER_INSTANCE, PARTICLES = "water_surface", "water", "particles"


class Surface(abc.ABC):
    """A skin whose vertices this package computes.

    Attributes:
        skin: Skin id.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, skin: int, prefix: str, look: Look
    ):
        """Binds it to a skin.

        Args:
            model, data: Simulation to render.
            skin: Skin id.
            prefix: Prefix of names of the containing model.
            look: Look of the model.
        """
        self.skin, first = skin, model.skin_vertadr[skin]
        self._part = slice(first, first + model.skin_vertnum[skin])
        self._num_faces = int(model.skin_facenum[skin])

    @abc.abstractmethod
    def write(self, vertices: np.ndarray, normals: np.ndarray) -> int:
        """Writes vertices (n, 3) [m] and normals (n, 3) of the skin into a scene.

        Returns:
            Number of leading faces of the skin that are not degenerate.
        """


class RopeSurface(Surface):
    """A tube along the vertices of a flex."""

    def __init__(self, model, data, skin, prefix, look):
        super().__init__(model, data, skin, prefix, look)
        flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, prefix + ROPE_FLEX)
        first = model.flex_vertadr[flex]
        self._points = data.flexvert_xpos[first : first + model.flex_vertnum[flex]]
        self._radius, self._shape = float(model.flex_radius[flex]), rope_shape(look)

    def write(self, vertices, normals):
        vertices[self._part], normals[self._part] = tube(self._points, self._radius, **self._shape)
        return self._num_faces


class WaterSurface(Surface):
    """Separate triangles around the particles of an instance of the fluid plugin."""

    def __init__(self, model, data, skin, prefix, look):
        super().__init__(model, data, skin, prefix, look)
        instance = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_PLUGIN, prefix + WATER_INSTANCE)
        first = model.plugin_stateadr[instance] + 1  # The layout of `Water.after_compile`.
        number, self._spacing = model.numeric(prefix + PARTICLES).data.tolist()
        self._points = data.plugin_state[first : first + 3 * int(number)].reshape(-1, 3)
        self._cell, self._most = look.water_cell, look.water_triangles

    def mesh(self, cell: float, most: int = MOST_TRIANGLES) -> Mesh:
        """Returns the surface for a cell size [rest distances] and a limit of triangles."""
        spacing = self._spacing
        return water_mesh(self._points, spacing, cell * spacing, most_triangles=most)

    def write(self, vertices, normals):
        mesh = self.mesh(self._cell, self._most)
        corners, own = mesh.faces.ravel(), vertices[self._part]
        own[: len(corners)], own[len(corners) :] = mesh.vertices[corners], 0.0
        normals[self._part][: len(corners)] = mesh.normals[corners]
        return len(mesh.faces)


def rope_shape(look: Look) -> dict:
    """Returns the arguments of `tube` for ropes."""
    return {
        "sides": look.rope_sides,
        "rings_per_edge": look.rope_rings,
        "strands": ROPE if look.is_stranded else PLAIN,
    }


_KINDS: dict[str, type[Surface]] = {ROPE_SKIN: RopeSurface, WATER_SKIN: WaterSurface}


def find_surfaces(model: mujoco.MjModel, data: mujoco.MjData, look: Look) -> list[Surface]:
    """Returns the surfaces of a model."""
    found = []
    for skin in np.flatnonzero(model.skin_group == DRAWN_SKINS).tolist():
        prefix, slash, name = model.skin(skin).name.rpartition("/")
        found.append(_KINDS[name](model, data, skin, prefix + slash, look))
    return found
