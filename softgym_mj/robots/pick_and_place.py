"""Pickers that complete a pick and place in one action (docs/softgym.md 2.5)."""

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from dm_control import composer

from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.metrics import Array, constant, namespace
from softgym_mj.robots.base import ActionSpace
from softgym_mj.robots.grip import GripCommand
from softgym_mj.robots.gripper import gripper_actions
from softgym_mj.robots.picker import Picker
from softgym_mj.robots.workspace import Workspace

STEP = 0.01  # [m] Displacement of a picker in a sim step.
MAX_STEPS = 300  # [sim steps] Longest leg; a target further away takes another action.
APPROACH_HEIGHT = 0.2  # [m] Height at which the pixel picker moves over its target,
PICK_HEIGHT = 0.01  # and height [m] above an object's resting height at which it picks.
LARGEST_OFFSET = 0.3  # [m] Largest offset of the place from the pick point along every axis.
SETTLE_STEPS = 20  # [sim steps] Rest after the release.
# Whether the pixel picker is closed in the parts of its route: over the point, down, rest, to the
# place, rest, rest after the release.
CLOSED = (False, False, True, True, True, False)


class Legs(NamedTuple):
    """Straight motions of n pickers.

    Attributes:
        end: end positions (..., n, 3) [m].
        step: displacement in each sim step (..., n, 3) [m].
        steps: number of sim steps (...).
    """

    end: Array
    step: Array
    steps: Array


def legs(start: Array, goals: Array, low: Array, high: Array) -> Legs:
    """Returns simultaneous straight motions of n pickers, each to or towards its goal.

    Args:
        start, goals: positions (..., n, 3) [m].
        low, high: ends of the workspace, to which goals are clipped (..., n, 3) [m].
    """
    xp = namespace(start)
    way = xp.maximum(xp.minimum(goals, high), low) - start
    squares = way * way  # Summed one by one: libraries sum in various orders.
    lengths = xp.sqrt(squares[..., 0] + squares[..., 1] + squares[..., 2])
    steps = xp.ceil(xp.max(lengths, axis=-1) / STEP - 1e-9)
    share = MAX_STEPS / xp.maximum(steps, xp.full_like(steps, MAX_STEPS))
    way = way * share[..., None, None]
    steps = xp.minimum(steps, xp.full_like(steps, MAX_STEPS))
    each = xp.maximum(steps, xp.ones_like(steps))
    return Legs(start + way, way / each[..., None, None], steps)


def shown_points(view: Array, pixels: Array, height: Array) -> Array:
    """Returns where rays of pixels meet a plane (..., 3) [m].

    A ray above the horizon gives the point below the camera.

    Args:
        view: cameras' positions, rotations by rows, and tangents of half their angle (..., 13).
        pixels: right and down, in [-1, 1] (..., 2).
        height: height of the plane [m].
    """
    xp = namespace(view)
    half, rotation = view[..., 12], view[..., 3:12].reshape((*view.shape[:-1], 3, 3))
    right, down = pixels[..., 0] * half, -pixels[..., 1] * half
    ray = (
        rotation[..., 0] * right[..., None] + rotation[..., 1] * down[..., None] - rotation[..., 2]
    )
    sinks = ray[..., 2] < 0.0
    depth = xp.where(sinks, -ray[..., 2], 1.0)
    way = xp.where(sinks, (view[..., 2] - height) / depth, 0.0)
    point = view[..., :3] + way[..., None] * ray
    return xp.stack([point[..., 0], point[..., 1], 0.0 * point[..., 2] + height], axis=-1)


def routes(
    start: Array, points: Array, actions: Array, low: Array, high: Array
) -> list[tuple[Array, Array]]:
    """Returns displacements per sim step (..., 1, 3) [m] and sim steps (...) of each part.

    Args:
        start: positions of pixel pickers (..., 1, 3) [m].
        points: points shown by their pixels (..., 3) [m].
        actions: (..., 5), as in `PixelPickAndPlace`.
        low, high: ends of the workspace (..., 1, 3) [m].
    """
    xp = namespace(start)
    pick = (points + constant([0.0, 0.0, PICK_HEIGHT], points))[..., None, :]
    place = xp.stack([actions[..., 2], actions[..., 3], (actions[..., 4] + 1.0) / 2.0], axis=-1)
    above = xp.concat([pick[..., :2], xp.full_like(pick[..., :1], APPROACH_HEIGHT)], axis=-1)
    over = legs(start, above, low, high)
    down = legs(over.end, pick, low, high)
    there = legs(down.end, down.end + LARGEST_OFFSET * place[..., None, :], low, high)
    rest, one = xp.zeros_like(start), xp.ones_like(over.steps)
    return [
        *(leg[1:] for leg in (over, down)), (rest, one), there[1:], (rest, one),
        (rest, SETTLE_STEPS * one),
    ]  # fmt: skip


class RoutePicker(Picker):
    """Picker whose action is a route; an env step lasts until the route ends."""

    horizon = 20
    sim_steps = 0
    displaces = False

    def _build(self, *args, **kwargs):
        super()._build(*args, **kwargs)
        self._route: list[GripCommand] = []
        self._next = 0

    def symmetries(self, turn: np.ndarray) -> tuple[()]:
        return ()

    def place(self, positions: np.ndarray, workspace: Workspace) -> None:
        super().place(positions, workspace)
        self.sim_steps = 0

    def _start(self) -> None:
        self._route, self._next = [], 0
        self._end = self._center.copy()

    def _go(self, goals: np.ndarray, grips: Sequence[bool]) -> None:
        """Adds a straight motion to `goals` (num_pickers, 3) [m], within the workspace."""
        leg = legs(self._end, goals, self._low, self._high)
        self._end = leg.end
        self._route += [GripCommand(leg.step, np.array(grips))] * int(leg.steps)

    def _stay(self, grips: Sequence[bool]) -> None:
        """Adds a sim step of rest."""
        self._route.append(GripCommand(np.zeros_like(self._end), np.array(grips)))
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

    The action has four entries for each picker: its target as a fraction of the workspace, from -1
    (low) to 1 (high) along X, Y, Z, and grip (> 0 closes, <= 0 opens), which holds for the whole
    motion and one sim step of rest. The pickers arrive together; the one with the longest path
    moves at 1 m/s.
    """

    name = "pick_and_place"

    @functools.cached_property
    def actions(self) -> ActionSpace:
        ends = "the workspace, low to high"
        return gripper_actions(self.num_grippers, [(f"target {axis}", "m", ends) for axis in "xyz"])

    def command(self, action: np.ndarray) -> None:
        action = action.reshape(-1, 4)
        grips = (action[:, 3] > 0.0).tolist()
        self._start()
        self._go(self._low + (action[:, :3] + 1.0) / 2.0 * (self._high - self._low), grips)
        self._stay(grips)


class PixelPickAndPlace(RoutePicker):
    """Picker that picks at a pixel of the task's camera and places elsewhere (Wu et al., 2020).

    The action has five entries: the pixel from -1 to 1 (left to right, top to bottom) and the place
    relative to the pick point: dX, dY from -0.3 m (-1) to 0.3 m (1) and dZ from 0 (-1) to 0.3 m
    (1). The pixel is projected onto the plane of an object that rests on the floor.
    """

    name = "pixel_pick_and_place"
    actions = ActionSpace(
        (
            ("pixel right", "", "left to right edge of the image"),
            ("pixel down", "", "upper to lower edge of the image"),
            *(
                (f"d{axis} of the place from the pick point", "m", f"{low:g} to {LARGEST_OFFSET:g}")
                for axis, low in (("X", -LARGEST_OFFSET), ("Y", -LARGEST_OFFSET), ("Z", 0.0))
            ),
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

    def view(self) -> np.ndarray:
        """Returns the camera (13,) for `shown_points`."""
        camera = self._camera_id
        half = math.tan(math.radians(self._model.cam_fovy[camera]) / 2)
        return np.array([*self._data.cam_xpos[camera], *self._data.cam_xmat[camera], half])

    def point(self, pixel: np.ndarray) -> np.ndarray:
        """Returns where the ray of a pixel (2,) in [-1, 1] meets the plane of the object (3,) [m].

        A ray above the horizon gives the point below the camera.
        """
        return shown_points(self.view(), pixel, np.float64(self._target.radius))

    def command(self, action: np.ndarray) -> None:
        ends = np.broadcast_to(self._low, (1, 3)), np.broadcast_to(self._high, (1, 3))
        parts = routes(self._center, self.point(action[:2]), action, *ends)
        self._start()
        for (step, steps), closed in zip(parts, CLOSED, strict=True):
            self._route += [GripCommand(step, np.array([closed]))] * int(steps)
        self.sim_steps = len(self._route)
