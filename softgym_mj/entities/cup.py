"""`Cup`: an open box of five walls that is moved by its pose (docs/softgym.md 3.0)."""

import dataclasses
import math
from collections.abc import Sequence

import mujoco
import numpy as np
from dm_control import composer, mjcf

from softgym_mj import metrics
from softgym_mj.entities.cup_size import CupSize, cup_mesh
from softgym_mj.entities.entity import UNSEEN_GEOMS, Entity
from softgym_mj.entities.room import add_material
from softgym_mj.rendering.look import GLASS, GRAPHITE
from softgym_mj.rendering.offscreen import GLASS_GROUP
from softgym_mj.validation import typed

_WALLS = ("floor", "left", "right", "back", "front")
# [m] Grip point of the handle: along Y from the cup's frame and above it. All cups are narrower. An
# arm's wrist may be 9 cm lower than its fingers when they point ahead.
GRIP = (0.0, 0.28, 0.2)
# [m] Handle: size along X, of its bar upwards, and beyond the grip.
_THICK, _TALL, _END = 0.02, 0.05, 0.015
HELD_WALL_MASS = 0.06  # [kg] Mass of each of the five walls of a cup in a hand: hard foam.


class Cup(Entity):
    """Open cup; its frame is at the middle of the floor slab, so it rests half sunk at z = 0.

    The pose is (x, z, theta): position of that point [m] and angle about +Y [rad]; positive theta
    tips the rim towards +X. It is read from mjData (`mocap_pos`, `mocap_quat`), so it is always
    current, with theta within +-2 pi. The pose of a cup in a hand is computed from the joints, with
    theta within +-pi. Only water collides with a cup.

    Attributes:
        body: body with the walls.
        size: inner size; changed by `resize`.
        arrays: arrays that depend on it: `size` (4,), length, width, height, wall [m].
    """

    @typed
    def _build(self, size: CupSize, name: str = "cup"):
        """Builds the cup upright at the origin.

        Args:
            size: its size.
            name: model name.
        """
        self._mjcf_root = mjcf.RootElement(model=name)
        self.body = self._mjcf_root.worldbody.add("body", name="cup")
        _add_boxes(self.body, _WALLS, group=UNSEEN_GEOMS)
        # A separate body, because all geoms of the cup are walls for the water.
        add_material(self._mjcf_root, "glass", GLASS)
        self._mesh = self._mjcf_root.asset.add("mesh", name="glass")
        self.body.add("body", name="glass").add(
            "geom", name="glass", type="mesh", mesh="glass", material="glass",
            group=GLASS_GROUP, contype=0, conaffinity=0, mass=0.0,
        )  # fmt: skip
        self._is_held = False
        self._set_size(size)

    def join(self, arena: composer.Arena) -> None:
        """Adds the cup to the scene as a mocap body, which moves by its pose alone."""
        arena.attach(self).mocap = "true"

    def join_hand(self, hand: composer.Entity, site: mjcf.Element) -> None:
        """Fixes the cup by a handle to a hand's site, which has the axes of the cup.

        It weighs 0.3 kg and transfers the forces of the water to the arm.
        """
        hand.attach(self, site)
        self.body.pos = -np.array(GRIP)
        handle = self._mjcf_root.worldbody.add("body", name="handle", pos=self.body.pos)
        _add_boxes(handle, ("post", "bar"), rgba=GRAPHITE.rgba)
        for body in (self.body, handle):
            body.gravcomp = 1.0  # The arm compensates the weight of its load.
        for wall in self.body.geom:
            wall.mass = HELD_WALL_MASS
        self._is_held = True
        self._set_size(self.size)

    def resize(self, size: CupSize) -> bool:
        """Resizes the cup; returns True if the model changed and must be recompiled."""
        if size == self.size:
            return False
        self._set_size(size)
        return True

    def _set_size(self, size: CupSize):
        self.size = size
        length, width, height, wall = dataclasses.astuple(size)
        self.arrays = {"size": np.array([length, width, height, wall])}
        side, end = (length + wall) / 2, (width + wall) / 2
        long = [wall / 2, width / 2 + wall, height / 2]
        short = [length / 2, wall / 2, height / 2]
        # SoftGym's back wall is at its smaller z, which is our larger Y.
        measures = {
            "floor": ([0.0, 0.0, 0.0], [length / 2 + wall, width / 2 + wall, wall / 2]),
            "left": ([-side, 0.0, height / 2], long),
            "right": ([side, 0.0, height / 2], long),
            "back": ([0.0, end, height / 2], short),
            "front": ([0.0, -end, height / 2], short),
        }
        if self._is_held:
            back, top = width / 2 + wall, GRIP[2] + _TALL / 2
            measures["post"] = [0.0, back + _THICK / 2, top / 2], [_THICK / 2, _THICK / 2, top / 2]
            middle, half = (GRIP[1] + _END + back) / 2, (GRIP[1] + _END - back) / 2
            measures["bar"] = [0.0, middle, GRIP[2]], [_THICK / 2, half, _TALL / 2]
        for name, (position, half) in measures.items():
            geom = self._mjcf_root.find("geom", name)
            geom.pos, geom.size = position, half
        vertices, faces = cup_mesh(size)
        self._mesh.vertex, self._mesh.face = vertices.ravel(), faces.ravel()

    # ------------------------------------------------------------------ simulation

    def after_compile(self, physics, random_state):
        model, data = physics.model.ptr, physics.data.ptr
        self._model, self._data = model, data
        body = model.body(self.body.full_identifier)
        if self._is_held:
            self.position, self.quaternion = data.xpos[body.id], data.xquat[body.id]
        else:
            mocap = model.body_mocapid[body.parentid[0]]
            self.position, self.quaternion = data.mocap_pos[mocap], data.mocap_quat[mocap]

    @property
    def pose(self) -> np.ndarray:
        """Pose (x [m], z [m], theta [rad]), a fresh array (3,); read-only for a cup in a hand."""
        if self._is_held:  # Computed from the joints: after a step, mjData has the previous pose.
            mujoco.mj_kinematics(self._model, self._data)
        angle = 2.0 * math.atan2(self.quaternion[2], self.quaternion[0])
        if self._is_held:
            angle = (angle + math.pi) % (2.0 * math.pi) - math.pi
        return np.array([self.position[0], self.position[2], angle])

    @pose.setter
    def pose(self, pose: np.ndarray) -> None:
        x, z, theta = pose.tolist()
        self.position[:] = x, 0.0, z
        self.quaternion[:] = math.cos(theta / 2), 0.0, math.sin(theta / 2), 0.0

    @property
    def whole_pose(self) -> np.ndarray:
        """Position [m], quaternion (w, x, y, z) and theta [rad]: (8,)."""
        theta = self.pose[2]
        return np.array([*self.position, *self.quaternion, theta])

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Returns which points (n, 3) [m] of the world are in the cup's box, rotated with it."""
        return metrics.inside(points, self.whole_pose, self.arrays["size"])

    @property
    def foot(self) -> np.ndarray:
        """Closed polygon (5, 2) [m] around its outer walls in top view, upright."""
        half = np.array([self.size.length, self.size.width]) / 2 + self.size.wall
        return half * [[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]


def _add_boxes(body: mjcf.Element, names: Sequence[str], **attributes: object) -> None:
    """Adds massless boxes without contact; `_set_size` sets their position and size."""
    for name in names:
        body.add(
            "geom", name=name, type="box", size=[1.0] * 3, contype=0, conaffinity=0, mass=0.0,
            **attributes,
        )  # fmt: skip
