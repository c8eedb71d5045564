"""Converts a MuJoCo scene to a Mitsuba scene: shapes, materials, lights."""

import itertools
from typing import Any

import mujoco
import numpy as np

from softgym_mj.rendering.drawing import MAX_GEOMS, show_surfaces
from softgym_mj.rendering.look import HORIZON, SKY, look_of
from softgym_mj.rendering.photo import shapes
from softgym_mj.rendering.photo.materials import Clear, bsdf, finish_of, linear
from softgym_mj.rendering.photo.shapes import Triangles
from softgym_mj.rendering.surfaces import WaterSurface, find_surfaces

# Factors of the sky's color at the horizon, where it is as bright as the floor of the room, and at
# the zenith; and factors of lights with shadows and of others.
HORIZON_LIGHT, ZENITH_LIGHT, SUN_LIGHT, OTHER_LIGHT = 0.76, 0.25, 1.5, 0.6
# Half the side of a softbox at distance 1, and its distance [m], which lights the room evenly.
LAMP_SIDE, LAMP_DISTANCE = 0.15, 300.0
# Water surface: cell size [rest distances], passes of the smoothing filter.
WATER_CELL, WATER_PASSES = 0.4, 12
_GEOM = mujoco.mjtGeom


class Scene:
    """Mitsuba scene of a model.

    Attributes:
        contents: Argument of Mitsuba's `load_dict`, without camera and light.
        names: Names of the model's geoms and skins by key of `contents`.
        is_clear: Whether it contains glass or water.
        seen: MuJoCo's scene with its camera and lights.
    """

    def __init__(
        self, mi: Any, model: mujoco.MjModel, data: mujoco.MjData, camera: mujoco.MjvCamera
    ):
        """Converts the current state of a model.

        Args:
            mi: Module of Mitsuba.
            model, data: Simulation to render.
            camera: Camera.
        """
        self._mi, self._model = mi, model
        self.seen = mujoco.MjvScene(model, MAX_GEOMS)
        option = mujoco.MjvOption()
        show_surfaces(option)
        everything = mujoco.mjtCatBit.mjCAT_ALL
        mujoco.mjv_updateScene(model, data, option, None, camera, everything, self.seen)
        vertices, normals = (
            values.reshape(-1, 3) for values in (self.seen.skinvert, self.seen.skinnormal)
        )
        self._water: dict[int, Triangles] = {}
        for surface in find_surfaces(model, data, look_of(model)):
            if isinstance(surface, WaterSurface):
                self._water[surface.skin] = shapes.smooth(surface.mesh(WATER_CELL), WATER_PASSES)
            else:
                surface.write(vertices, normals)
        self.contents: dict[str, Any] = {}
        self.names: dict[str, str] = {}
        self.is_clear = False
        self._materials: dict[tuple, Any] = {}
        for geom in itertools.islice(self.seen.geoms, self.seen.ngeom):
            if geom.category != mujoco.mjtCatBit.mjCAT_DECOR:  # Decoration, such as plugins draw.
                self._add(geom)

    def _add(self, geom: mujoco.MjvGeom) -> None:
        triangles = self._triangles(geom)
        if triangles is None or not len(triangles.faces):
            return
        key = f"part_{len(self.contents)}"
        kind = mujoco.mjtObj(geom.objtype) if geom.objtype else mujoco.mjtObj.mjOBJ_GEOM
        self.names[key] = mujoco.mj_id2name(self._model, kind, geom.objid) or ""
        self.contents[key] = self._mesh(key, triangles, self._material(geom, triangles))

    def _triangles(self, geom: mujoco.MjvGeom) -> Triangles | None:
        """Returns the surface of a geom in the world frame."""
        if geom.type == _GEOM.mjGEOM_SKIN:
            return self._skin(geom.objid)
        if geom.type != _GEOM.mjGEOM_MESH:
            own = shapes.shape(geom.type, geom.size)
        else:
            own = shapes.mesh(self._model, geom.dataid // 2)  # Odd ids are convex hulls.
            if isinstance(finish_of(self._model, geom.matid), Clear):
                own = shapes.weighted(own.vertices, own.faces)
        if own is None:
            return None
        texcoords = own.texcoords
        is_flat = geom.type in (_GEOM.mjGEOM_PLANE, _GEOM.mjGEOM_BOX)
        if is_flat and texcoords is not None and geom.matid >= 0:
            if not self._model.mat_texuniform[geom.matid]:
                texcoords = 0.5 + texcoords / np.ptp(texcoords, axis=0)
            texcoords = texcoords * self._model.mat_texrepeat[geom.matid]
        turn = geom.mat.T
        normals = None if own.normals is None else own.normals @ turn
        return Triangles(own.vertices @ turn + geom.pos, normals, texcoords, own.faces)

    def _skin(self, skin: int) -> Triangles:
        if skin in self._water:
            return self._water[skin]
        model = self._model
        first, count = model.skin_vertadr[skin], model.skin_vertnum[skin]
        texcoords, at = None, model.skin_texcoordadr[skin]
        if at >= 0:
            texcoords = model.skin_texcoord[at : at + count]
        vertices, normals = (
            values.reshape(-1, 3)[first : first + count]
            for values in (self.seen.skinvert, self.seen.skinnormal)
        )
        faces = model.skin_face[model.skin_faceadr[skin] :][: model.skin_facenum[skin]]
        return Triangles(vertices, normals, texcoords, faces)

    def _material(self, geom: mujoco.MjvGeom, triangles: Triangles) -> Any:
        """Returns the BSDF, shared by all parts of one material."""
        has_texture = triangles.texcoords is not None
        key = (geom.matid, *geom.rgba, geom.specular, geom.shininess, has_texture)
        if key not in self._materials:
            self._materials[key] = bsdf(self._mi, self._model, geom, has_texture)
        self.is_clear |= isinstance(finish_of(self._model, geom.matid), Clear)
        return self._materials[key]

    def _mesh(self, name: str, triangles: Triangles, material: Any) -> Any:
        properties = self._mi.Properties()
        properties["bsdf"] = material
        vertices, normals, texcoords, faces = triangles
        mesh = self._mi.Mesh(
            name, len(vertices), len(faces), has_vertex_normals=normals is not None,
            has_vertex_texcoords=texcoords is not None, props=properties,
        )  # fmt: skip
        values = self._mi.traverse(mesh)
        values["vertex_positions"] = np.ascontiguousarray(vertices, np.float32).ravel()
        values["faces"] = np.ascontiguousarray(faces, np.uint32).ravel()
        if normals is not None:
            values["vertex_normals"] = np.ascontiguousarray(normals, np.float32).ravel()
        if texcoords is not None:  # Mitsuba's origin is at the bottom.
            upright = np.column_stack([texcoords[:, 0], 1.0 - texcoords[:, 1]])
            values["vertex_texcoords"] = np.ascontiguousarray(upright, np.float32).ravel()
        values.update()
        return mesh

    def lights(self) -> dict[str, Any]:
        """Returns a softbox for each light of the model, and a sky."""
        mi = self._mi
        found: dict[str, Any] = {"sky": self._sky()}
        for i, lamp in enumerate(itertools.islice(self.seen.lights, self.seen.nlight)):
            if lamp.headlight:
                continue
            place = np.array(lamp.pos) - LAMP_DISTANCE * np.array(lamp.dir)
            gain = SUN_LIGHT if lamp.castshadow else OTHER_LIGHT
            # A square of side 2 s at the distance 1, of radiance 1, lights a floor by 4 s^2.
            radiance = gain * np.pi * np.array(lamp.diffuse) / (2.0 * LAMP_SIDE) ** 2
            pose = mi.ScalarTransform4f().look_at(
                place.tolist(), (place + lamp.dir).tolist(), [0.0, 0.0, 1.0]
            )
            half = LAMP_SIDE * LAMP_DISTANCE
            found[f"lamp_{i}"] = {
                "type": "rectangle",
                "to_world": pose @ mi.ScalarTransform4f().scale(half),
                "emitter": {"type": "area", "radiance": {"type": "rgb", "value": radiance}},
            }
        return found

    def _sky(self) -> dict[str, Any]:
        """Returns the sky gradient of the look, from the horizon to the zenith."""
        mi, rows = self._mi, 32
        height = np.clip(np.linspace(1.0, -1.0, rows), 0.0, 1.0)[:, None]
        zenith, horizon = ZENITH_LIGHT * linear(SKY), HORIZON_LIGHT * linear(HORIZON)
        light = height * zenith + (1.0 - height) * horizon
        picture = np.repeat(light[:, None], 2 * rows, axis=1).astype(np.float32)
        upright = mi.ScalarTransform4f().rotate([1, 0, 0], 90)
        return {"type": "envmap", "bitmap": mi.Bitmap(picture), "to_world": upright}

    def sensor(self, size: int) -> dict[str, Any]:
        """Returns the camera of MuJoCo's scene for square images."""
        mi, (left, right) = self._mi, self.seen.camera
        place = (np.array(left.pos) + right.pos) / 2.0
        angle = 2.0 * np.degrees(
            np.arctan((left.frustum_top - left.frustum_bottom) / 2 / left.frustum_near)
        )
        pose = mi.ScalarTransform4f().look_at(
            place.tolist(), (place + left.forward).tolist(), np.array(left.up).tolist()
        )
        film = {
            "type": "hdrfilm", "width": size, "height": size, "pixel_format": "rgb",
            # A box filter keeps the noise of pixels independent, as the denoiser requires.
            "rfilter": {"type": "box"},
        }  # fmt: skip
        return {
            "type": "perspective", "fov": float(angle), "fov_axis": "y", "to_world": pose,
            "near_clip": 0.01, "far_clip": 1000.0, "film": film, "sampler": {"type": "independent"},
        }  # fmt: skip
