"""Pickers that go all the way in one action: `PickAndPlace` and `PixelPickAndPlace` (facts 2.5)."""

import functools
import math
from collections.abc import Sequence

import numpy as np
from dm_control import composer

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.native.arithmetic import product
from softgym_mj.robots.base import ActionSpace
from softgym_mj.robots.grip import GripCommand
from softgym_mj.robots.gripper import gripper_actions
from softgym_mj.robots.picker import Picker

STEP = 0.01  # [m] Way of a picker in a sim step.
MAX_STEPS = 300  # Sim steps of a way; what is further is reached with the next action.
APPROACH_HEIGHT = 0.2  # [m] At which the pixel picker moves over what it will take,
PICK_HEIGHT = 0.01  # and height [m] above an object's resting height at which it takes it.
LARGEST_OFFSET = 0.3  # [m] Of the place from the pick point along every axis.
SETTLE_STEPS = 20  # Sim steps after the pixel picker has let go.


class RoutePicker(Picker):
    """A picker whose action is a route: it takes as many sim steps as that needs."""

    horizon = 20
    sim_steps = 0
    displaces = False

    def _build(self, *args, **kwargs):
        super()._build(*args, **kwargs)
        self._route: list[GripCommand] = []
        self._next = 0

    def _start(self) -> None:
        self._route, self._next = [], 0
        self._end = self._centre.copy()

    def _go(self, goals: np.ndarray, grips: Sequence[bool]) -> None:
        """Adds a straight way to `goals` (num_pickers, 3) [m], within the workspace."""
        way = np.clip(goals, self._low, self._high) - self._end
        steps = int(np.ceil(np.linalg.norm(way, axis=1).max() / STEP - 1e-9))
        if steps > MAX_STEPS:
            way, steps = way * (MAX_STEPS / steps), MAX_STEPS
        self._end = self._end + way
        self._route += [GripCommand(way / max(steps, 1), np.array(grips))] * steps

    def _stay(self, grips: Sequence[bool], steps: int = 1) -> None:
        """Adds sim steps of rest."""
        self._route += [GripCommand(np.zeros_like(self._end), np.array(grips))] * steps
        self.sim_steps = len(self._route)

    def plan(self) -> None:
        self._command = self._route[self._next]
        self._next += 1
        super().plan()

    def get_state(self) -> dict[str, np.ndarray]:
        return {**super().get_state(), "sim_steps": np.array(self.sim_steps)}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        super().set_state(state)
        self.sim_steps = int(state["sim_steps"])

    def diagnostics(self) -> dict[str, float | int]:
        return {**super().diagnostics(), "sim_steps": self.sim_steps}


class PickAndPlace(RoutePicker):
    """Pickers that move to absolute targets.

    The action has four entries a picker: its target as a fraction of the workspace, from -1 (low)
    to 1 (high) along X, Y, Z, and grip (> 0 closes, <= 0 opens), which holds for the whole way and
    the one sim step of rest at its end. The pickers arrive together; the one with
    the longer way moves at 1 m/s.
    """

    name = "pick_and_place"

    @functools.cached_property
    def actions(self) -> ActionSpace:
        ends = "-1 and 1 are the ends of the workspace"
        return gripper_actions(self.num_grippers, [(f"target {axis}", "m", ends) for axis in "xyz"])

    def command(self, action: np.ndarray) -> None:
        action = action.reshape(-1, 4)
        grips = (action[:, 3] > 0.0).tolist()
        self._start()
        self._go(self._low + (action[:, :3] + 1.0) / 2.0 * (self._high - self._low), grips)
        self._stay(grips)


class PixelPickAndPlace(RoutePicker):
    """One picker that takes what a pixel of the task's camera shows and puts it down elsewhere.

    The action has five entries: the pixel from -1 to 1 (left to right, top to bottom) and the place
    relative to the pick point: dX, dY from -0.3 m (-1) to 0.3 m (1) and dZ from 0 (-1) to 0.3 m
    (1). The pixel is taken to show the plane at which the object rests on the floor. Used by Wu et
    al. 2020.
    """

    name = "pixel_pick_and_place"
    actions = ActionSpace(
        (
            ("pixel right", "", "-1 is the left edge of the image, 1 the right one"),
            ("pixel down", "", "-1 is the upper edge of the image, 1 the lower one"),
            ("dX of the place from the pick point", "m", f"±1 is {LARGEST_OFFSET:g} m"),
            ("dY of the place from the pick point", "m", f"±1 is {LARGEST_OFFSET:g} m"),
            ("dZ of the place from the pick point", "m", f"-1 is 0, 1 is {LARGEST_OFFSET:g} m"),
        ),
        "pixel right, pixel down, dX, dY, dZ",
    )

    def _build(self, *args, **kwargs):
        super()._build(*args, **kwargs)
        if self.num_grippers != 1:
            raise InvalidArgumentError("num_pickers", self.num_grippers, "1: one pixel, one picker")

    def join(self, arena: composer.Arena) -> None:
        super().join(arena)
        self._camera = arena.mjcf_model.find("camera", "task").full_identifier

    def after_compile(self, physics, random_state):
        super().after_compile(physics, random_state)
        self._model, self._data = physics.model.ptr, physics.data.ptr
        self._camera_id = self._model.camera(self._camera).id

    def point(self, pixel: np.ndarray) -> np.ndarray:
        """Where the ray of a pixel (2,) in [-1, 1] meets the plane of the resting object (3,) [m].

        A ray that looks above the horizon gives the point below the camera.
        """
        camera = self._camera_id
        half = math.tan(math.radians(self._model.cam_fovy[camera]) / 2)
        rotation = self._data.cam_xmat[camera].reshape(3, 3)
        origin = self._data.cam_xpos[camera]
        ray = product(rotation, np.array([pixel[0] * half, -pixel[1] * half, -1.0]))
        height = self._target.radius
        way = (origin[2] - height) / -ray[2] if ray[2] < 0.0 else 0.0
        return np.array([*(origin + way * ray)[:2], height])

    def command(self, action: np.ndarray) -> None:
        pick = self.point(action[:2]) + [0.0, 0.0, PICK_HEIGHT]
        offset = LARGEST_OFFSET * np.array([*action[2:4], (action[4] + 1.0) / 2.0])
        self._start()
        self._go(np.array([[*pick[:2], APPROACH_HEIGHT]]), [False])
        self._go(pick[None], [False])
        taken = self._end[0].copy()
        self._stay([True])
        self._go((taken + offset)[None], [True])
        self._stay([True])  # What is let go on the way would fly on.
        self._stay([False], SETTLE_STEPS)
