"""`SceneCamera`: a camera that renders a scene according to its look."""

import itertools

import mujoco
import numpy as np
from dm_control.mujoco import engine

from softgym_mj.rendering.look import GAMMA, SUN_RADIUS, look_of
from softgym_mj.rendering.skins import DRAWN_SKINS, SHOWN_FLEXES
from softgym_mj.rendering.surfaces import Surface, find_surfaces

MAX_GEOMS = 2000  # Limit of a scene: arms made of meshes have some hundred geoms.
CLEAR = 0.5  # Opacity below which a geom casts no shadow: OpenGL's shadows of glass are black.
# Geoms of the room, below all others, cast no shadows. Software OpenGL would draw speckles on them
# because it rounds depths differently in the shadow map and in the image.
GROUND = ("table", "table_edge", "room")
_GEOM, _SITE = int(mujoco.mjtObj.mjOBJ_GEOM), int(mujoco.mjtObj.mjOBJ_SITE)
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
_LIGHT = (np.arange(256) / 255.0).astype(np.float32) ** GAMMA  # Linear light of pixel values.


def _halton(index: int, base: int) -> float:
    """Returns element `index` of a low-discrepancy sequence in 0..1."""
    result, part = 0.0, 1.0
    while index:
        part /= base
        index, digit = divmod(index, base)
        result += digit * part
    return result


class SceneCamera(engine.Camera):
    """dm_control camera that also renders ropes and water.

    Ropes and water are skins with one bone; their vertices are written after MuJoCo has updated the
    scene.

    Attributes:
        look: Look of the model.
    """

    def __init__(self, physics, height: int, width: int, camera: int):
        """Binds the camera to physics.

        Args:
            physics: Simulation to render.
            height, width: Size of images [pixels].
            camera: Camera id of the model, -1 for the free camera.
        """
        super().__init__(physics, height, width, camera, max_geom=MAX_GEOMS)
        model = physics.model.ptr
        self.look = look_of(model)
        self._water: mujoco.MjvGeom | None = None  # Translucent water in the scene.
        self._surfaces: list[Surface] = find_surfaces(model, physics.data.ptr, self.look)
        ids = (mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name) for name in GROUND)
        self._ground = {i for i in ids if i >= 0}
        show_surfaces(self.option)
        self._drawn, self._last = np.empty(0), np.empty(0)  # `_parts` of the last image, and it.

    def update(self, scene_option=None):
        super().update(scene_option)
        scene = self.scene.ptr
        for surface in self._surfaces:
            # Degenerate faces would take 0.3 microseconds each.
            scene.skinfacenum[surface.skin] = surface.write(
                scene.skinvert.reshape(-1, 3), scene.skinnormal.reshape(-1, 3)
            )
        self._water = None
        for geom in itertools.islice(scene.geoms, scene.ngeom):
            is_skin = geom.type == mujoco.mjtGeom.mjGEOM_SKIN
            if is_skin and geom.rgba[3] < 1.0:
                self._water = geom
            is_clear = geom.rgba[3] < CLEAR and not is_skin
            # OpenGL draws only the front of water, which gets the opacity of front and rear, and
            # MuJoCo draws translucent geoms twice (`mjr_render`): each coat gets half the opacity.
            through = 1.0 - geom.rgba[3]
            geom.rgba[3] = 1.0 - (through**2 if is_skin else through**0.5)
            is_ground = geom.objtype == _GEOM and geom.objid in self._ground
            if is_clear or is_ground or geom.objtype == _SITE:  # Sites are marks, not things.
                geom.category = mujoco.mjtCatBit.mjCAT_DECOR

    def surfaces(self) -> tuple[np.ndarray, np.ndarray]:
        """Renders segmentation and depth in one pass, at the centers of pixels.

        A color pass has several samples per pixel; OpenGL would return the depth of an off-center
        sample.

        Returns:
            Segmentation (height, width, 2) int, id and `mujoco.mjtObj` or -1 for none, and depth
            (height, width) [m].
        """
        shown = self.render(segmentation=True)
        contexts, model = self._physics.contexts, self._physics.model
        with contexts.gl.make_current() as context:
            context.call(
                mujoco.mjr_readPixels, None, self._depth_buffer, self._rect, contexts.mujoco.ptr
            )
        near, far = (model.stat.extent * end for end in (model.vis.map.znear, model.vis.map.zfar))
        depth = near / (1.0 - self._depth_buffer * (1.0 - near / far))
        return shown, contexts.gl.to_pixels(depth)

    def colors(self, passes: int | None, still: float | None = None) -> np.ndarray:
        """Renders an image (height, width, 3) uint8 as the mean of several passes.

        Each of several passes moves the sun on a disc and shifts the camera by less than a pixel.

        Args:
            passes: Number of passes; None for the look's.
            still: Motion [m] of everything drawn up to which the last image is returned; None
                renders always.
        """
        passes = passes or self.look.passes
        self.update()
        if still is not None:
            parts = self._parts()
            if parts.shape == self._drawn.shape and np.abs(parts - self._drawn).max() <= still:
                return self._last
            self._drawn = parts
        contexts = self._physics.contexts
        with contexts.gl.make_current() as context:
            if passes == 1:
                context.call(self._draw)
            else:
                context.call(self._accumulate, passes)
        image = contexts.gl.to_pixels(self._rgb_buffer)
        if still is not None:
            image = self._last = image.copy()  # Other images use the same buffer.
        return image

    def _parts(self) -> np.ndarray:
        """Returns numbers (n,) of everything drawn: places [m], directions, sizes [m], colors."""
        scene = self.scene.ptr
        parts = [scene.skinvert, scene.skinfacenum, scene.flexvert]
        for geom in itertools.islice(scene.geoms, scene.ngeom):
            parts += [geom.pos, geom.mat, geom.size, geom.rgba]
        for light in itertools.islice(scene.lights, scene.nlight):
            parts += [light.pos, light.dir, light.diffuse]
        for eye in scene.camera:
            parts += [eye.pos, eye.forward, eye.up]
        return np.concatenate([np.ravel(part) for part in parts])

    def _draw(self) -> None:
        """Renders an image; one of translucent water mixes two, without and with opaque water.

        MuJoCo draws translucent geoms one after the other, by their distances. Blending is linear:
        the mixture has the glass behind the water, then the water, then the glass before it.
        """
        if self._water is None:
            self._render_on_gl_thread(depth=False, overlays=())
            return
        opacity = self._water.rgba[3]
        mixed = np.zeros(self._rgb_buffer.shape, np.float32)
        for drawn, share in ((0.0, 1.0 - opacity), (1.0, opacity)):
            self._water.rgba[3] = drawn
            self._render_on_gl_thread(depth=False, overlays=())
            mixed += share * self._rgb_buffer
        self._water.rgba[3] = opacity
        self._rgb_buffer[:] = np.round(mixed)

    def _accumulate(self, passes: int) -> None:
        scene = self.scene.ptr
        suns = [light for light in itertools.islice(scene.lights, scene.nlight) if light.castshadow]
        at = [(np.array(sun.pos), np.array(sun.dir)) for sun in suns]
        frames = [(eye.frustum_center, eye.frustum_bottom, eye.frustum_top) for eye in scene.camera]
        pixel = (frames[0][2] - frames[0][1]) / self.height
        total = np.zeros(self._rgb_buffer.shape, np.float32)
        for i in range(passes):
            radius, angle = SUN_RADIUS * np.sqrt((i + 0.5) / passes), _GOLDEN_ANGLE * i
            for sun, (place, direction) in zip(suns, at, strict=True):
                side = np.cross(direction, [0.0, 1.0, 0.0])
                side /= np.linalg.norm(side)
                away = np.cos(angle) * side + np.sin(angle) * np.cross(direction, side)
                moved = direction - radius * away
                distance = np.linalg.norm(place)
                sun.pos[:] = place + radius * distance * away
                sun.dir[:] = moved / np.linalg.norm(moved)
            dx, dy = (pixel * (_halton(i + 1, base) - 0.5) for base in (2, 3))
            for eye, (center, bottom, top) in zip(scene.camera, frames, strict=True):
                eye.frustum_center = center + dx
                eye.frustum_bottom, eye.frustum_top = bottom + dy, top + dy
            self._draw()
            total += _LIGHT[self._rgb_buffer]
        np.multiply(255.0, (total / passes) ** (1.0 / GAMMA), out=total)
        self._rgb_buffer[:] = np.round(total)


def show_surfaces(option) -> None:
    """Shows ropes and water by their skins instead of MuJoCo's flexes and geoms."""
    option.skingroup[DRAWN_SKINS] = 1
    option.flexgroup[SHOWN_FLEXES] = 0
