"""`Grasp`: how the fingers of arms hold vertices of a flex: attached or by friction."""

import abc
from collections.abc import Callable, Mapping

import numpy as np

from softgym_mj.cloth import solver
from softgym_mj.native.arithmetic import product, squares
from softgym_mj.robots.arm.fingers import Fingers
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.grip import NONE, GripCommand, GripLimits
from softgym_mj.robots.holding import Attachment, Holding

# [m] Largest distance from the tool point to a vertex that closing fingers catch: they open to 2 x
# 4 cm (Franka).
PICK_DISTANCE = 0.03
ANYWHERE = GripLimits(np.array(-np.inf), np.array(np.inf), PICK_DISTANCE)
DRAW_SPEED = 0.3  # [m/s] Speed at which closing fingers draw in a caught vertex.
# [m/s] Speed of each finger's command in a grip by friction: cloth slips if it is faster.
CLOSING_SPEED = 0.1
PRESSING = 0.7  # Least cosine between a pad's push and its closing direction in a grip.


class Grasp(Holding, abc.ABC):
    """Holds of the hands of arms, and motion of their fingers.

    Call order: `plan` in every sim step, `move` in every physics step, then `sense`.
    """

    tip_clearance: float  # [m] Height of the finger tips over the floor at the lowest command.
    hold_height: float  # [m] Height of the tool point above a vertex that hangs from it.
    pad_contact: Mapping[str, object]  # Contact attributes of the pads' geoms.
    least_pad = (0.0, 0.0)  # [m] Least half width and half length of the pads' geoms.

    def use(self, fingers: Fingers) -> None:
        """Sets the fingers, once the scene is compiled."""
        self._fingers = fingers
        self._solid = np.ones(len(self.grips.held), bool)  # Whether the fingers push the object.

    def reset(self) -> None:
        super().reset()
        self._solid[:] = True
        self._fingers.open()

    def get_state(self) -> dict[str, np.ndarray]:
        return {**super().get_state(), "solid": self._solid.copy()}

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        super().set_state(state)
        self._solid = state["solid"].copy()

    @abc.abstractmethod
    def take_at(self, i: int, vertex: int, tool: np.ndarray) -> None:
        """Closes hand `i`, whose tool point is at `tool` (3,) [m], on a vertex."""

    @abc.abstractmethod
    def plan(self, closed: np.ndarray, tools: np.ndarray) -> None:
        """Starts a sim step with commands `closed` (n,) and tool points `tools` (n, 3) [m]."""

    @abc.abstractmethod
    def move(self, ahead: Callable[[float], np.ndarray], timestep: float) -> None:
        """Starts a physics step of `timestep` [s].

        `ahead(timestep)` returns the predicted tool points (n, 3) [m] at its end.
        """

    @abc.abstractmethod
    def sense(self, closed: np.ndarray, positions: Callable[[], np.ndarray]) -> None:
        """Ends a sim step; `positions()` returns the tool points (n, 3) [m]."""


class AttachGrasp(Grasp, Attachment):
    """Holds as pickers do: a vertex is attached to the tool point.

    A hand that grips and holds nothing takes the vertex nearest to its tool point within the pick
    distance; its fingers close and draw the vertex in between them. Closed fingers pass through the
    object.
    """

    tip_clearance = 0.015  # A jerk may use all of it.
    hold_height = 0.0
    pad_contact: Mapping[str, object] = {}

    def take_at(self, i: int, vertex: int, tool: np.ndarray) -> None:
        self.take(i, vertex, self._target.vertex(vertex) - tool)
        arm = self._fingers.arm
        self._fingers.put(i, arm.finger_range[0], arm.finger_commands[0])

    def plan(self, closed: np.ndarray, tools: np.ndarray) -> None:
        self.grips = self.grips._replace(center=tools)
        self.step(GripCommand(np.zeros_like(tools), closed), ANYWHERE)
        # Closing fingers are not solid, because they would squeeze the object out; they become
        # solid again when they are open and clear of the object.
        fingers = self._fingers
        shut, opened = fingers.arm.finger_commands
        for i, grip in enumerate(closed):
            fingers.data.ctrl[fingers.motors[i]] = shut if grip else opened
            if grip:
                self._solid[i] = False
            elif not self._solid[i]:
                self._solid[i] = fingers.clear(i, self._target.displacements_from(tools[i]))
            fingers.set_solid(i, self._solid[i])

    def move(self, ahead: Callable[[float], np.ndarray], timestep: float) -> None:
        if any(vertex >= 0 for vertex in self.vertices):
            offsets = self.grips.offset
            distance = np.maximum(np.sqrt(squares(offsets)), 1e-9)[:, None]
            offsets *= np.maximum(1.0 - DRAW_SPEED * timestep / distance, 0.0)
            self.drive(ahead(timestep), timestep)

    def sense(self, closed: np.ndarray, positions: Callable[[], np.ndarray]) -> None:
        pass  # Attached vertices need no sensing.


class FrictionGrasp(Grasp):
    """Holds by contact alone: solid pads press on the object from both sides.

    While its grip is on, a hand counts as holding a vertex of the elements (triangles of a cloth,
    segments of a rope) that both pads press on, towards each other: first the one nearest to the
    tool point, then the same as long as the pads press there. `dropped` counts how often that
    ended, because the grip opened or the object slipped. Opening pads are not solid, so that the
    object does not stay hooked to them; they become solid again when they are clear of the object,
    or when they close.
    """

    # The pads must reach below the middle of a sheet, which is 5 mm high: with 4 mm, one edge in
    # four escapes below a narrow pad. A jerk may take them 2 mm into the floor, with which they do
    # not collide.
    tip_clearance = 0.002
    hold_height = -0.012  # From the object's end on, the pads touch it.
    # Stiff, for rigid bodies; the cloth plugin computes contact with flexes.
    pad_contact: Mapping[str, object] = {
        "condim": 4,
        "friction": (1.5, 0.05, 0.001),
        "solref": (0.005, 1.0),
        "solimp": (0.99, 0.9999, 0.004),
    }
    # Pads narrower than a quarter of the vertex spacing of a cloth cut in between vertices. On the
    # upper end of shorter ones, folds come to rest, where real fingers continue.
    least_pad = (0.0075, 0.02)

    def take_at(self, i: int, vertex: int, tool: np.ndarray) -> None:
        self.grips.held[i] = vertex
        radius = self._target.radius  # The pads touch the object and begin to close.
        self._fingers.put(i, radius, radius)

    def plan(self, closed: np.ndarray, tools: np.ndarray) -> None:
        fingers = self._fingers
        # The command ends where the pads meet: some newtons hold, and more hold no better.
        shut, opened = fingers.arm.finger_range
        for i, grip in enumerate(closed):
            command = fingers.data.ctrl[fingers.motors[i]]
            closer = np.maximum(command - CLOSING_SPEED * SIM_STEP, shut)
            fingers.data.ctrl[fingers.motors[i]] = closer if grip else opened
            if grip:
                self._solid[i] = True
            elif not self._solid[i] or command.min() < opened:
                self._solid[i] = fingers.clear(i, self._target.displacements_from(tools[i]))
            fingers.set_solid(i, self._solid[i])

    def move(self, ahead: Callable[[float], np.ndarray], timestep: float) -> None:
        pass  # Contact holds the object.

    def sense(self, closed: np.ndarray, positions: Callable[[], np.ndarray]) -> None:
        tools = positions() if closed.any() else np.zeros((0, 3))
        for i, (grip, before) in enumerate(zip(closed, self.vertices, strict=True)):
            vertex = self._nearest(self._pinched(i), tools[i], before) if grip else NONE
            if before >= 0 > vertex:
                self._drop(i)
            self.grips.held[i] = vertex

    def _nearest(self, vertices: np.ndarray, tool: np.ndarray, before: int) -> int:
        """Returns the held one of `vertices`: the same as `before`, or the nearest to a tool."""
        if not len(vertices):
            return NONE
        if before in vertices:
            return before
        offsets = self._target.displacements_from(tool)[vertices]
        return int(vertices[squares(offsets).argmin()])

    def _pinched(self, i: int) -> np.ndarray:
        """Returns vertices of the elements that both pads of arm `i` pressed on last."""
        fingers = self._fingers
        contact = solver.contacts(fingers.model, fingers.data)
        pinched = np.arange(fingers.model.nflexvert)
        for pad in fingers.pads[i]:
            inward = -fingers.data.geom_xmat[pad].reshape(3, 3)[:, 1]
            towards = product(contact["normal"], inward) > PRESSING
            pressed = contact["vertex"][(contact["geom"] == pad) & towards]
            pinched = np.intersect1d(pinched, pressed)
        return np.flatnonzero(np.isin(self._target.vertex_ids, pinched))


GRASPS: dict[str, type[Grasp]] = {"attach": AttachGrasp, "friction": FrictionGrasp}
