"""`Scene`: a model in a browser: bodies by mjviser; flexes and water by this module."""

import copy
from typing import Any
from unittest import mock

import mujoco
import numpy as np

from softgym_mj.exceptions import import_extra
from softgym_mj.rendering.drawing import MAX_GEOMS, show_surfaces
from softgym_mj.rendering.look import look_of
from softgym_mj.rendering.offscreen import refresh
from softgym_mj.rendering.surfaces import find_surfaces
from softgym_mj.rendering.textures import texture_of

EXTRA = "viewer"  # Extra that installs viser and mjviser.
AMBIENCE = 0.4  # Intensity of ambient light; with mjviser's 0.8, colors are washed out.
# Number of texture patches along its height, whose mean colors are compared, and the least
# difference of two colors (sum over channels): threads differ less, the sides of a cloth more.
PATCHES, ALIKE = 32, 0.35
RARE = 0.1  # Share of a skin's faces below which a color is ignored.
_SHOWN_GROUPS = 3  # Further groups are collision geoms.


def skin_parts(model: mujoco.MjModel, skin: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Returns the colors (4,) of a textured skin, and the faces (n, 3) of each color."""
    first, number = model.skin_faceadr[skin], model.skin_facenum[skin]
    faces = model.skin_face[first : first + number]
    material = model.skin_matid[skin]
    rgba = model.mat_rgba[material]
    texture = texture_of(model, material)
    if texture is None:
        return [(rgba, faces)]
    # Means of patches suppress threads.
    pixels, side = texture / 255.0, len(texture) // PATCHES
    cells = pixels[: PATCHES * side].reshape(PATCHES, side, -1, side, 3).mean(axis=(1, 3))
    first, number = model.skin_texcoordadr[skin], model.skin_vertnum[skin]
    places = model.skin_texcoord[first : first + number][faces].mean(axis=1)
    row, column = (places[:, ::-1] % 1.0 * cells.shape[:2]).astype(int).T
    colors = cells[row, column]
    # The most common color, then the most common of those that differ; intermediate colors are
    # ignored.
    kept: list[np.ndarray] = []
    left = np.ones(len(faces), bool)
    while left.mean() > RARE:
        bins, which = np.unique(np.round(6.0 * colors[left]), axis=0, return_inverse=True)
        commonest = which.ravel() == np.bincount(which.ravel(), minlength=len(bins)).argmax()
        color = colors[left][commonest].mean(axis=0)
        alike = left & (np.abs(colors - color).sum(axis=1) < ALIKE)
        kept.append(colors[alike].mean(axis=0))
        left &= ~alike
    nearest = np.abs(colors[:, None] - np.array(kept)).sum(axis=2).argmin(axis=1)
    return [(rgba * [*color, 1.0], faces[nearest == i]) for i, color in enumerate(kept)]


def _opacity(rgba: np.ndarray) -> float | None:
    return None if rgba[3] == 1.0 else float(rgba[3])


def _bytes(rgba: np.ndarray) -> tuple[int, int, int]:
    red, green, blue = (round(255 * float(value)) for value in rgba[:3])
    return red, green, blue


class Scene:
    """Model in the scene of a viser server.

    mjviser draws bodies, but translucent ones opaque, and neither skins, flexes nor water.
    """

    def __init__(self, server: Any, physics: Any):
        """Builds the scene of a model, replacing the previous one of a `viser.ViserServer`."""
        mjviser = import_extra("mjviser", "mjviser", EXTRA)
        self._server, self._model = server, physics.model.ptr
        self._data = mujoco.MjData(self._model)
        self._picture = mujoco.MjvScene(self._model, MAX_GEOMS)
        self._option, self._camera = mujoco.MjvOption(), mujoco.MjvCamera()
        show_surfaces(self._option)
        self._surfaces = find_surfaces(self._model, self._data, look_of(self._model))
        self._parts = []
        for skin in range(self._model.nskin):
            parts = []
            for rgba, faces in skin_parts(self._model, skin):
                used, own = np.unique(faces, return_inverse=True)
                parts.append((rgba, used, own.reshape(-1, 3)))
            self._parts.append(parts)
        self._built = self._shape()
        server.scene.reset()
        server.scene.set_up_direction("+z")
        opaque = copy.copy(self._model)  # mjviser writes into its model, too.
        material = opaque.geom_matid
        rgba = np.where(material[:, None] < 0, opaque.geom_rgba, opaque.mat_rgba[material])
        shown = opaque.geom_group < _SHOWN_GROUPS
        clear = np.flatnonzero((rgba[:, 3] > 0.0) & (rgba[:, 3] < 1.0) & shown)
        floors = opaque.geom_type == mujoco.mjtGeom.mjGEOM_PLANE  # The room's floor would be white.
        opaque.geom_type[floors] = mujoco.mjtGeom.mjGEOM_BOX
        for hidden in (clear, floors):  # mjviser skips transparent geoms.
            opaque.geom_matid[hidden], opaque.geom_rgba[hidden, 3] = -1, 0.0
        server.scene.configure_environment_map(environment_intensity=AMBIENCE)
        # Browsers load this light asynchronously: of two calls, either may come last.
        with mock.patch.object(server.scene, "configure_environment_map"):
            self._bodies = mjviser.ViserMujocoScene(server, opaque, num_envs=1)
        self._bodies.camera_tracking_enabled = False
        self._frames = {
            body: self._add_clear(body, clear, rgba)
            for body in np.unique(self._model.geom_bodyid[clear]).tolist()
        }
        self._meshes: dict[str, Any] = {}
        self.update(physics)

    def shows(self, physics: Any) -> bool:
        """Returns whether the scene shows this physics with its current goal marks."""
        if physics.model.ptr is not self._model:
            return False
        return all(np.array_equal(a, b) for a, b in zip(self._shape(), self._built, strict=True))

    def _shape(self) -> list[np.ndarray]:
        model = self._model
        geoms = model.geom_pos.copy(), model.geom_quat.copy(), model.geom_size.copy()
        return [*geoms, model.site_pos.copy(), model.site_quat.copy(), model.site_size.copy()]

    def update(self, physics: Any) -> None:
        """Shows the current state."""
        mujoco.mj_copyData(self._data, self._model, physics.data.ptr)
        refresh(self._model, self._data)
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(
            self._model, self._data, self._option, None, self._camera, everything, self._picture
        )
        with self._server.atomic():
            self._bodies.update_from_mjdata(self._data)
            for body, frame in self._frames.items():
                frame.position, frame.wxyz = self._data.xpos[body], self._data.xquat[body]
            self._show_skins()

    # ------------------------------------------------------------------ parts

    def _add_clear(self, body: int, clear: np.ndarray, rgba: np.ndarray) -> Any:
        """Adds the translucent geoms of a body to a frame that moves with it."""
        conversions = import_extra("mjviser.conversions", "mjviser", EXTRA)
        frame = self._server.scene.add_frame(f"/clear/{body}", show_axes=False)
        for geom in clear[self._model.geom_bodyid[clear] == body]:
            if self._model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
                mesh = conversions.mujoco_mesh_to_trimesh(self._model, geom)
            else:
                mesh = conversions.create_primitive_mesh(self._model, geom)
            self._server.scene.add_mesh_simple(
                f"/clear/{body}/{geom}",
                np.array(mesh.vertices),
                np.array(mesh.faces),
                color=_bytes(rgba[geom]),
                opacity=_opacity(rgba[geom]),
                flat_shading=True,
                cast_shadow=False,
                position=self._model.geom_pos[geom],
                wxyz=self._model.geom_quat[geom],
            )
        return frame

    def _show_skins(self) -> None:
        vertices = self._picture.skinvert.reshape(-1, 3)
        normals = self._picture.skinnormal.reshape(-1, 3)
        written = {surface.skin: surface.write(vertices, normals) for surface in self._surfaces}
        for skin, parts in enumerate(self._parts):
            first = self._model.skin_vertadr[skin]
            for i, (rgba, used, faces) in enumerate(parts):
                shown = faces[: written.get(skin, len(faces))]  # Water fills a part of its skin.
                own = vertices[first + used[: shown.max(initial=-1) + 1]]
                self._show(f"/skins/{skin}/{i}", own, shown, rgba)

    def _show(self, name: str, vertices: np.ndarray, faces: np.ndarray, rgba: np.ndarray) -> None:
        vertices = np.asarray(vertices, np.float32)
        mesh = self._meshes.get(name)
        if mesh is None:
            self._meshes[name] = self._server.scene.add_mesh_simple(
                name, vertices, faces, color=_bytes(rgba), opacity=_opacity(rgba)
            )
            return
        mesh.vertices = vertices
        if len(mesh.faces) != len(faces):
            mesh.faces = faces
