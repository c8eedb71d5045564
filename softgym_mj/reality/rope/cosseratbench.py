"""`RodSolver`: this package's rope as a solver of cosseratbench, a benchmark of slender rods.

The entry point `softgym_mj` of the group `cosseratbench.solvers` names it; `cosseratbench run
--solver softgym_mj` runs all experiments.
"""

import functools
import importlib.metadata
import math
from typing import Any

import numpy as np

from softgym_mj.exceptions import SimulationError, import_extra
from softgym_mj.reality.rope.cable import Properties
from softgym_mj.reality.rope.ends import End, Motion
from softgym_mj.reality.rope.rods import Rod, RodScene

SUBSTEPS = 10  # Substeps of a step.
# Substep times the fastest bending frequency. Bending has one sweep per substep: with 0.25 a
# twisted rod buckles 1.4 % too early, with 0.5 4.3 %.
_BEND = 0.125
_LONGEST = 2e-4  # [s] Longest substep.
_DYNAMIC = 1e-5  # [s] The same if the motion is the result, which implicit steps damp.
_ALONG = 0.999  # Least cosine of the angle between a sliding end and its slide.
# Ranges of the plugin's attributes.
_RANGES = {"stretch": (1e-3, 1e6), "bend": (0.0, 1.0), "twist": (0.0, 1.0), "friction": (0.0, 10.0)}


class RodSolver:
    """Solver of cosseratbench (its protocol `Solver`).

    Attributes:
        name: Name in the benchmark's results.
        backend_version: Version of this package.
    """

    name = "softgym_mj"
    backend_version = importlib.metadata.version("softgym_mj")

    def __init__(self, time_step_scale: float = 1.0):
        """Creates the solver; `time_step_scale` multiplies its time step."""
        self._scale = time_step_scale

    @functools.cached_property
    def capabilities(self) -> frozenset:
        """Physics that it models: everything except for shear."""
        capability = _benchmark("solver").Capability
        return frozenset(capability) - {capability.SHEAR}

    def settings(self, scenario: Any, *, n_elements: int, n_frames: int) -> dict[str, float]:
        """Returns the numerical choices for a `cosseratbench.Scenario`, which results record."""
        step, _ = self._steps(scenario, n_elements, n_frames)
        return {
            "time_step": step / SUBSTEPS,
            "substeps": SUBSTEPS,
            "damping_rate": _damping(scenario),
            "contact_radius": min(_rod(r, n_elements, 0.0).contact_radius for r in scenario.rods),
        }

    def run(self, scenario: Any, *, n_elements: int, n_frames: int) -> Any:
        """Simulates a `cosseratbench.Scenario` and returns its `Trajectory`.

        Raises:
            Diverged: If the simulation diverges.
            NotImplementedError: For stiffness or friction beyond the plugin's range, and for a
                sliding end that is displaced or does not slide along the rod.
        """
        step, steps = self._steps(scenario, n_elements, n_frames)
        damping = _damping(scenario)
        scene = RodScene(
            [_rod(rod, n_elements, damping) for rod in scenario.rods],
            [_geom(obstacle) for obstacle in scenario.obstacles],
            gravity=scenario.gravity,
            timestep=step,
            substeps=SUBSTEPS,
        )
        frames: list = []
        try:
            frames.extend(scene.frames(n_frames, steps))
        except SimulationError as error:
            time = len(frames) * steps * step
            raise _benchmark("solver").Diverged(str(error), time) from error
        rods = range(len(scenario.rods))
        nodes, directors = (
            tuple(np.stack([frame[rod][k] for frame in frames]) for rod in rods) for k in (0, 1)
        )
        times = np.linspace(0.0, scenario.duration, n_frames)
        return _benchmark("trajectory").Trajectory(times, nodes, directors)

    def _steps(self, scenario: Any, n_elements: int, n_frames: int) -> tuple[float, int]:
        """Physics step [s] and number of them between frames."""
        interval = scenario.duration / (n_frames - 1)
        substep = _LONGEST if scenario.quasi_static else _DYNAMIC
        for rod in scenario.rods:
            material = rod.material
            speed = math.sqrt(material.youngs_modulus / material.density) * rod.radius / 2.0
            substep = min(substep, _BEND * (rod.length / n_elements) ** 2 / (4.0 * speed))
        steps = math.ceil(interval / (self._scale * SUBSTEPS * substep))
        return interval / steps, steps


def _benchmark(module: str) -> Any:
    return import_extra(f"cosseratbench.{module}", "cosseratbench", "cosserat")


def _damping(scenario: Any) -> float:
    """Rate of damping by mass [1/s]: critical for the slowest mode if equilibrium is asked for."""
    return 2.0 * scenario.slowest_frequency() if scenario.quasi_static else 0.0


def _rod(rod: Any, n_elements: int, damping: float) -> Rod:
    material, density = rod.material, rod.material.density * rod.area
    properties = Properties(
        density=density,
        stretch=material.youngs_modulus * rod.area,
        bend=material.youngs_modulus * rod.second_moment_of_area,
        twist=2.0 * material.shear_modulus * rod.second_moment_of_area,
        stretch_damping=0.0,
        bend_damping=0.0,
        air_damping=damping * density,
        radius=rod.radius,
        friction=rod.friction,
    )
    for name, (low, high) in _RANGES.items():
        if not low <= getattr(properties, name) <= high:
            raise NotImplementedError(f"{name} beyond {low:g} to {high:g}")
    forces = {"start": np.zeros(3), "end": np.zeros(3)}
    for load in rod.loads:
        forces[load.at.value] += load.force
    nodes = rod.nodes(n_elements)
    ends = (
        _end(rod.start, rod.start_motion, forces["start"], nodes[1] - nodes[0]),
        _end(rod.end, rod.end_motion, forces["end"], nodes[-1] - nodes[-2]),
    )
    return Rod(nodes, rod.length, rod.directors(n_elements)[0], properties, ends)


def _end(condition: Any, motion: Any, force: np.ndarray, way: np.ndarray) -> End:
    if motion is None:
        return End(condition.value, force=force)
    values = motion.times, motion.displacement, motion.rotation
    path = Motion(*(np.asarray(value, float) for value in values))
    slide = None
    if motion.slides_along is not None:
        slide = motion.axis
        if np.any(path.displacement) or abs(slide @ way) < _ALONG * np.linalg.norm(way):
            raise NotImplementedError("ends that slide across the rod or are displaced")
    return End(condition.value, path, slide, force)


def _geom(obstacle: Any) -> dict[str, Any]:
    """Attributes of an obstacle in MJCF."""
    geom = {"type": obstacle.kind, "friction": [obstacle.friction, 0.0, 0.0]}
    if obstacle.kind == "plane":
        size = [0.0, 0.0, 1.0]  # Infinite.
        return geom | {"pos": obstacle.point, "zaxis": obstacle.unit_normal, "size": size}
    half = obstacle.unit_axis * obstacle.length / 2.0
    ends = np.concatenate([obstacle.center - half, obstacle.center + half])
    return geom | {"fromto": ends, "size": [obstacle.radius]}
