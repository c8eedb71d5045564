"""What a browser shows of a model: its bodies by mjviser, the soft and the liquid by us."""

import copy
from typing import Any
from unittest import mock

import mujoco
import numpy as np

from softgym_mj.exceptions import import_extra
from softgym_mj.rendering.offscreen import refresh

EXTRA = "viewer"  # The extra that brings viser and mjviser.
AMBIENCE = 0.4  # Of light from all sides; with mjviser's 0.8, colours are bleached.
WATER_OPACITY = 0.85
WATER_GEOMS = 4000  # In a picture: coarse water has 3000 triangles at most, besides the model's.
TUBE_SIDES = 8  # Of the polygon that stands for the section of a rope.
_HIDDEN_GROUP = 4  # Of flexes that are shown by skins.
_SHOWN_GROUPS = 3  # Geoms of further groups are there for contact.
# The floor: colours of its tiles, their side and that of the whole [m]. It is darker than MuJoCo's,
# as the light is brighter, and cups are translucent.
FLOOR_COLORS = ((150, 152, 155), (122, 124, 127))
TILE, FLOOR_SIDE = 0.5, 8.0


def tube(points: np.ndarray, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """A tube around a chain of points, with flat ends.

    Args:
        points: of its axis (n, 3) [m], no two neighbours at the same place.
        radius: of its section [m].

    Returns:
        Vertices (n TUBE_SIDES + 2, 3) [m] and triangles (2 n TUBE_SIDES, 3) that face outwards.
    """
    along = np.gradient(points, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    normals = np.empty_like(points)
    normal = np.eye(3)[np.abs(along[0]).argmin()]
    for i, direction in enumerate(along):  # Carried along, so that the tube is not twisted.
        normal = normal - (normal @ direction) * direction
        normal = normal / np.linalg.norm(normal)
        normals[i] = normal
    angles = 2 * np.pi * np.arange(TUBE_SIDES) / TUBE_SIDES
    sections = (
        np.cos(angles)[:, None] * normals[:, None]
        + np.sin(angles)[:, None] * np.cross(along, normals)[:, None]
    )
    vertices = (points[:, None] + radius * sections).reshape(-1, 3)
    number, last = len(points), len(vertices)
    this, following = np.arange(TUBE_SIDES), np.roll(np.arange(TUBE_SIDES), -1)
    rings = TUBE_SIDES * np.arange(number - 1)[:, None]
    a, b = rings + this, rings + following
    c, d = a + TUBE_SIDES, b + TUBE_SIDES
    end = TUBE_SIDES * (number - 1)
    faces = [
        np.stack([a, b, c], -1),
        np.stack([b, d, c], -1),
        np.stack([following, this, np.full(TUBE_SIDES, last)], -1),
        np.stack([end + this, end + following, np.full(TUBE_SIDES, last + 1)], -1),
    ]
    triangles = np.concatenate([part.reshape(-1, 3) for part in faces])
    return np.concatenate([vertices, points[[0, -1]]]), triangles


def joined(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (m, 3) and triangles (n, 3) of triangles (n, 3, 3) that share corners."""
    points = corners.reshape(-1, 3)
    _, first, faces = np.unique(np.round(points, 5), axis=0, return_index=True, return_inverse=True)
    return points[first], faces.reshape(-1, 3)


def _bytes(rgba: np.ndarray) -> tuple[int, int, int]:
    red, green, blue = (round(255 * float(value)) for value in rgba[:3])
    return red, green, blue


class Scene:
    """A model in the scene of a viser server.

    Bodies are mjviser's, except for translucent ones, which it draws opaque. Skins, flexes and
    water it does not draw at all.
    """

    def __init__(self, server: Any, physics: Any):
        """Builds the scene in place of what the server has shown.

        Args:
            server: a `viser.ViserServer`.
            physics: what is shown.

        Raises:
            UnavailableError: if mjviser is missing.
        """
        mjviser = import_extra("mjviser", "mjviser", EXTRA)
        self._server, self._model = server, physics.model.ptr
        self._data = mujoco.MjData(self._model)
        self._picture = mujoco.MjvScene(self._model, self._model.ngeom + WATER_GEOMS)
        self._option, self._camera = mujoco.MjvOption(), mujoco.MjvCamera()
        self._option.flexgroup[_HIDDEN_GROUP] = 0
        self._built = self._shape()
        server.scene.reset()
        server.scene.set_up_direction("+z")
        opaque = copy.copy(self._model)  # mjviser writes into its model, too.
        alpha = opaque.geom_rgba[:, 3]
        shown = opaque.geom_group < _SHOWN_GROUPS
        clear = np.flatnonzero((alpha > 0.0) & (alpha < 1.0) & shown)
        alpha[clear] = 0.0
        # It would draw a white floor whatever its colour: what is transparent it leaves out.
        floors = opaque.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
        opaque.geom_type[floors], alpha[floors] = mujoco.mjtGeom.mjGEOM_BOX, 0.0
        self._add_floor()
        server.scene.configure_environment_map(environment_intensity=AMBIENCE)
        # Browsers load the light of such a call for a while: of two, either may come last.
        with mock.patch.object(server.scene, "configure_environment_map"):
            self._bodies = mjviser.ViserMujocoScene(server, opaque, num_envs=1)
        self._bodies.camera_tracking_enabled = False
        self._frames = {
            body: self._add_clear(body, clear)
            for body in np.unique(self._model.geom_bodyid[clear]).tolist()
        }
        self._meshes: dict[str, Any] = {}
        self.update(physics)

    def shows(self, physics: Any) -> bool:
        """Whether it is the scene of this physics; goals that were moved make it another one."""
        if physics.model.ptr is not self._model:
            return False
        return all(np.array_equal(a, b) for a, b in zip(self._shape(), self._built, strict=True))

    def _shape(self) -> list[np.ndarray]:
        model = self._model
        return [model.geom_pos.copy(), model.geom_quat.copy(), model.geom_size.copy()]

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
            self._show_flexes()
            self._show_water()

    # ------------------------------------------------------------------ parts

    def _add_floor(self) -> None:
        """Adds tiles of two colours, which show distances and take shadows."""
        number = round(FLOOR_SIDE / TILE)
        edge = TILE * (np.arange(number) - number / 2)
        x, y = (part.ravel() for part in np.meshgrid(edge, edge))
        corners = np.array([[0, 0], [TILE, 0], [TILE, TILE], [0, TILE]])
        tiles = np.stack([x, y], -1)[:, None] + corners
        odd = np.round((x + y) / TILE).astype(int) % 2 == 1
        for name, color, chosen in zip(("a", "b"), FLOOR_COLORS, (odd, ~odd), strict=True):
            points = tiles[chosen].reshape(-1, 2)
            first = 4 * np.arange(len(points) // 4)[:, None, None]
            self._server.scene.add_mesh_simple(
                f"/floor/{name}",
                np.column_stack([points, np.zeros(len(points))]),
                (first + [[0, 1, 2], [0, 2, 3]]).reshape(-1, 3),
                color=color,
                side="double",
                cast_shadow=False,
            )

    def _add_clear(self, body: int, clear: np.ndarray) -> Any:
        """Adds the translucent geoms of a body to a frame that is moved with it."""
        conversions = import_extra("mjviser.conversions", "mjviser", EXTRA)
        frame = self._server.scene.add_frame(f"/clear/{body}", show_axes=False)
        for geom in clear[self._model.geom_bodyid[clear] == body]:
            mesh = conversions.create_primitive_mesh(self._model, geom)
            rgba = self._model.geom_rgba[geom]
            self._server.scene.add_mesh_simple(
                f"/clear/{body}/{geom}",
                np.array(mesh.vertices),
                np.array(mesh.faces),
                color=_bytes(rgba),
                opacity=float(rgba[3]),
                flat_shading=True,
                cast_shadow=False,
                position=self._model.geom_pos[geom],
                wxyz=self._model.geom_quat[geom],
            )
        return frame

    def _show_skins(self) -> None:
        model, picture = self._model, self._picture
        for skin in range(model.nskin):
            first, number = model.skin_vertadr[skin], model.skin_vertnum[skin]
            points = picture.skinvert.reshape(-1, 3)[first : first + number]
            first, number = model.skin_faceadr[skin], model.skin_facenum[skin]
            faces = model.skin_face[first : first + number]
            material = model.skin_matid[skin]
            rgba = model.skin_rgba[skin] if material < 0 else model.mat_rgba[material]
            self._show(f"/skins/{skin}", points, faces, rgba)

    def _show_flexes(self) -> None:
        """Ropes as tubes; sheets that no skin shows by their triangles."""
        model, data = self._model, self._data
        for flex in range(model.nflex):
            if model.flex_group[flex] == _HIDDEN_GROUP:
                continue
            first = model.flex_vertadr[flex]
            points = data.flexvert_xpos[first : first + model.flex_vertnum[flex]]
            rgba, dim = model.flex_rgba[flex], model.flex_dim[flex]
            if dim == 1:
                self._show(f"/flexes/{flex}", *tube(points, model.flex_radius[flex]), rgba)
            elif dim == 2:
                start = model.flex_elemdataadr[flex]
                elements = model.flex_elem[start : start + 3 * model.flex_elemnum[flex]]
                self._show(f"/flexes/{flex}", points, elements.reshape(-1, 3), rgba, side="double")

    def _show_water(self) -> None:
        """The triangles that the fluid plugin draws."""
        geoms = self._picture.geoms[: self._picture.ngeom]
        drawn = [geom for geom in geoms if geom.type == mujoco.mjtGeom.mjGEOM_TRIANGLE]
        for instance in {geom.objid for geom in drawn}:
            own = [geom for geom in drawn if geom.objid == instance]
            corner = np.array([geom.pos for geom in own])
            sides = np.array([geom.mat for geom in own])
            corners = corner[:, None] + np.stack(
                [np.zeros_like(corner), sides[..., 0], sides[..., 1]], axis=1
            )
            self._show(f"/water/{instance}", *joined(corners), own[0].rgba, opacity=WATER_OPACITY)

    def _show(
        self, name: str, vertices: np.ndarray, faces: np.ndarray, rgba: np.ndarray, **looks: Any
    ) -> None:
        vertices = np.asarray(vertices, np.float32)
        mesh = self._meshes.get(name)
        if mesh is None:
            self._meshes[name] = self._server.scene.add_mesh_simple(
                name, vertices, faces, color=_bytes(rgba), **looks
            )
            return
        mesh.vertices = vertices
        if not np.array_equal(mesh.faces, faces):
            mesh.faces = np.asarray(faces, np.uint32)
