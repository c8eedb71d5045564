"""`RodScene`: rods whose ends are free, pinned, clamped, driven or sliding, among fixed obstacles.

A clamped end has a second held vertex just beyond it, which holds the direction of the rod there.
Bending at the end vertex then acts on half an element, so that the rod is clamped at its end and
not in the middle of an element. Rods that are clamped at both ends twist.

A sliding end is held, too, and moved by its own equation of motion: vertices so close to each other
that are tied to a body on a slide hold a direction too softly (cloth/plugin/README.md, loads).
"""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import Any

import mujoco
import numpy as np
from dm_control import mjcf

from softgym_mj.cloth import solver
from softgym_mj.cloth.frames import transported
from softgym_mj.entities.flex import FLEX
from softgym_mj.exceptions import SimulationError
from softgym_mj.reality.rope.cable import Cable, Properties
from softgym_mj.reality.rope.ends import End, rolls
from softgym_mj.reality.solver import step

# Length of the edge beyond a clamped end, relative to an element. The clamp is in its middle. With
# a power of two the weights of the bending row have no rounding errors.
_STUB = 1.0 / 128.0
# Largest radius relative to an element. Second neighbors are one element apart and must not touch.
_MOST_RADIUS = 0.495


@dataclasses.dataclass(frozen=True)
class Rod:
    """A rod of n elements that are equally long at rest; it is straight without load.

    Attributes:
        nodes: Positions (n + 1, 3) [m] at the start, at which the rod is at rest.
        length: Rest length [m].
        director: Material direction (3,) across the first element. The rod starts without twist.
        properties: Properties, except for `length`.
        ends: First and last end.
    """

    nodes: np.ndarray
    length: float
    director: np.ndarray
    properties: Properties
    ends: tuple[End, End]

    @property
    def element(self) -> float:
        """Rest length of an element [m]."""
        return self.length / (len(self.nodes) - 1)

    @property
    def contact_radius(self) -> float:
        """Radius at which the rod touches others and itself [m]."""
        return min(self.properties.radius, _MOST_RADIUS * self.element)

    @property
    def twists(self) -> bool:
        """Whether both ends hold their frames."""
        return self.ends[0].is_clamped and self.ends[1].is_clamped


class RodScene:
    """Rods in a model of their own."""

    def __init__(
        self,
        rods: Sequence[Rod],
        obstacles: Sequence[dict[str, Any]] = (),
        *,
        gravity: Sequence[float] = (0.0, 0.0, 0.0),
        timestep: float,
        substeps: int,
    ):
        """Compiles the model.

        Args:
            rods: Rods.
            obstacles: Attributes of fixed geoms, as in MJCF.
            gravity: (3,) [m/s^2].
            timestep: Physics step [s].
            substeps: Substeps of a step.
        """
        root = mjcf.RootElement(model="rods")
        root.option.gravity = list(gravity)
        root.option.timestep = timestep
        for obstacle in obstacles:
            root.worldbody.add("geom", **obstacle)
        self._timestep = timestep
        self._rods = [
            _SceneRod(root, rod, f"rod{i}", timestep, substeps) for i, rod in enumerate(rods)
        ]
        self._physics = mjcf.Physics.from_mjcf_model(root)
        # The first loop moves all vertices back to the origin.
        for rod in self._rods:
            rod.cable.after_compile(self._physics, None)
        for rod in self._rods:
            rod.start(self._physics)
        mujoco.mj_forward(self._physics.model.ptr, self._physics.data.ptr)

    def frames(self, number: int, steps: int) -> Iterator[list[tuple[np.ndarray, np.ndarray]]]:
        """Simulates; yields nodes (n + 1, 3) [m] and directors (n, 3) of each rod in each frame.

        Args:
            number: Number of frames, the start included.
            steps: Steps between frames.

        Raises:
            SimulationError: If the simulation diverges.
        """
        times = self._timestep * np.arange((number - 1) * steps + 1)
        for rod in self._rods:
            rod.plan(times)
        yield [rod.frame(0) for rod in self._rods]
        for i in range(1, len(times)):
            for rod in self._rods:
                rod.drive(i)
            if not step(self._physics.model.ptr, self._physics.data.ptr):
                raise SimulationError(f"diverged at {times[i]:.3f} s")
            if i % steps == 0:
                yield [rod.frame(i) for rod in self._rods]


class _SceneRod:
    """A rod of a scene.

    Attributes:
        cable: Its vertices are the nodes and the stubs beyond clamped ends.
    """

    def __init__(self, root: mjcf.RootElement, rod: Rod, name: str, timestep: float, substeps: int):
        self._rod, self._name = rod, name
        before, after = (int(end.is_clamped) for end in rod.ends)
        count = len(rod.nodes)
        self._nodes = slice(before, before + count)
        self._ends = [
            _SceneEnd(rod, False, [before, 0][: before + 1]),
            _SceneEnd(rod, True, [before + count - 1, before + count][: after + 1]),
        ]
        spacing = np.full(count - 1, rod.element)
        spacing = np.pad(spacing, (before, after), constant_values=_STUB * rod.element)
        properties = dataclasses.replace(
            rod.properties,
            radius=rod.contact_radius,
            twist=rod.properties.twist if rod.twists else 0.0,
        )
        self.cable = Cable(spacing, properties, name, timestep, substeps)
        root.attach(self.cable.mjcf_model)

    def start(self, physics: mjcf.Physics) -> None:
        """Places the rod in the compiled model."""
        points = np.zeros((self.cable.num_points, 3))
        points[self._nodes] = self._rod.nodes
        for end in self._ends:
            points[end.vertices] = end.points
        self.cable.set_points(points)
        self._director = self._rod.director
        self._tangent = self._rod.nodes[1] - self._rod.nodes[0]
        model, data = physics.model.ptr, physics.data.ptr
        for end in self._ends:
            end.start(self.cable, model, data)
        self._twist = np.zeros(1)
        if self._rod.twists:
            name = f"{self._name}/{FLEX}"
            flex = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_FLEX, name)
            self._twist = solver.twist_angle(model, data, flex)

    def plan(self, times: np.ndarray) -> None:
        """Computes the motion of the ends at the start and after each step, (s,) [s]."""
        for end in self._ends:
            end.plan(times)

    def drive(self, i: int) -> None:
        """Moves the ends in step i."""
        turn = sum(end.drive(self.cable, i) for end in self._ends)
        if self._rod.twists:
            self._twist += turn

    def frame(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns nodes (n + 1, 3) [m] and directors (n, 3) after step i."""
        points, (first, last) = self.cable.points(), self._ends
        nodes = points[self._nodes]
        if first.is_clamped:
            directors = transported(points, first.directors[i], float(self._twist[0]))[self._nodes]
            return nodes, directors[: len(nodes) - 1]
        if last.is_clamped:
            return nodes, transported(points[::-1], last.directors[i])[::-1][: len(nodes) - 1]
        # Free frames do not spin: the first edge carries its frame from frame to frame.
        tangent = nodes[1] - nodes[0]
        edges = np.cumsum([0.0 * tangent, self._tangent, tangent], axis=0)
        self._director, self._tangent = transported(edges, self._director)[1], tangent
        return nodes, transported(nodes, self._director)


class _SceneEnd:
    """An end of a rod in a scene.

    Attributes:
        vertices: The end vertex and, if it is clamped, that of the stub.
        points: Their positions (k, 3) [m] at the start.
        directors: Material directions (s, 3) of a clamped end at the planned times.
    """

    def __init__(self, rod: Rod, last: bool, vertices: Sequence[int]):
        self._rod, self._end, self.vertices = rod, rod.ends[last], vertices
        self._neighbor = vertices[0] + (-1 if last else 1)
        out = rod.nodes[-1] - rod.nodes[-2] if last else rod.nodes[0] - rod.nodes[1]
        stub = _STUB * rod.element
        if self._end.slide is not None:
            out = np.sign(self._end.slide @ out) * self._end.slide
            # Bending rows resist differences in strain between neighbors: none from the load.
            stub *= 1.0 + self._end.force @ out / rod.properties.stretch
        self._out, self._sign = out / np.linalg.norm(out), 1.0 if last else -1.0
        self._offsets = np.outer(stub * np.arange(len(vertices)), self._out)
        self.points = rod.nodes[-1 if last else 0] + self._offsets
        self._director = transported(rod.nodes, rod.director)[-1 if last else 0]
        self._slid, self._speed = 0.0, 0.0

    @property
    def is_clamped(self) -> bool:
        """Whether it holds its material direction."""
        return self._end.is_clamped

    def start(self, cable: Cable, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Holds the vertices or applies the force."""
        if self._end.held == "free":
            body = model.flex_vertbodyid[cable.vertex_ids[self.vertices[0]]]
            data.xfrc_applied[body, :3] = self._end.force
            return
        for vertex in self.vertices:
            cable.hold(vertex)

    def plan(self, times: np.ndarray) -> None:
        """Computes the motion at the start and after each step, (s,) [s]."""
        moved, turned = self._end.motion.poses(times)
        offsets = self._offsets @ turned.transpose(0, 2, 1)
        self._targets = self.points[0] + moved[:, None] + offsets
        self.directors = turned @ self._director
        self._rolls = rolls(turned @ (self._sign * self._out), self.directors)

    def drive(self, cable: Cable, i: int) -> float:
        """Moves held vertices in step i; returns the twist [rad] that the end adds to the rod."""
        if self._end.held == "free":
            return 0.0
        slid = 0.0 if self._end.slide is None else self._slide(cable)
        for vertex, target in zip(self.vertices, self._targets[i], strict=True):
            cable.drive(vertex, target + slid * self._out, cable.timestep)
        return float(self._sign * self._rolls[i - 1])

    def _slide(self, cable: Cable) -> float:
        """Steps the sliding end; returns its displacement [m] out of the rod.

        Half an element of mass is pulled by the load and by the last element, whose stiffness is
        implicit.
        """
        properties, element, timestep = self._rod.properties, self._rod.element, cable.timestep
        edge = cable.vertex(self.vertices[0]) - cable.vertex(self._neighbor)
        length = math.sqrt(edge @ edge)
        tension = properties.stretch * (length / element - 1.0) * (edge @ self._out) / length
        mass = properties.density * element / 2.0
        inertia = mass + timestep * properties.air_damping * element / 2.0
        inertia += timestep**2 * properties.stretch / element
        push = self._end.force @ self._out - tension
        self._speed = (mass * self._speed + timestep * push) / inertia
        self._slid += timestep * self._speed
        return self._slid
