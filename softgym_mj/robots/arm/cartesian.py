"""`CartesianController`: joint motions that follow tool points of arms, by mink.

Differential inverse kinematics on a model of the arms alone: a quadratic program computes joint
velocities that follow the commanded tool points, keep the tools upright, stay near the home posture
and within the limits of joints and speeds. All arms share one program, which costs no more than one
arm's. The reference is a separate configuration without feedback from contact, so the same commands
always give the same reference.
"""

import itertools
from collections.abc import Mapping, Sequence

import mink
import mujoco
import numpy as np

from softgym_mj.robots.arm.command_filter import drawn_in
from softgym_mj.robots.arm.kinematics import Clearance, Reference, Summed, ToolTask

PERIOD = 0.02  # [s] Period of solutions: 50 Hz.
# Costs of the tasks [1/m, 1/rad]. A firm orientation makes a Panda jump near singular poses.
POSITION_COST, ORIENTATION_COST = 1.0, 0.05
POSTURE_COST = 1e-3  # With 3e-3, arms stop 1 cm short where they are stretched out.
# Gain of the posture task: share of the way home per step. With 1, an elbow that is released swings
# by 0.03 rad in 10 ms and tears away what the hand holds taut.
POSTURE_GAIN = 0.05
# The second grows with the square of the error [1/m^2]: it damps arms at the end of their reach.
DAMPING, TASK_DAMPING = 1e-6, 10.0
LIMIT_GAIN = 0.5  # Fraction of the distance to a joint's limit that a solution may use.
LIMIT_MARGIN = 1e-3  # [rad] Least distance of a configuration from the limits.
# [m] Least distance of two arms; within `AWARE` of it they slow down: a solution may use the
# fraction `APPROACH` of the rest.
CLEARANCE, AWARE, APPROACH = 0.06, 0.1, 0.2
FLOOR_CLEARANCE = 0.01  # [m] Least distance of an arm from the floor.
# [m] Largest distance of a commanded point from the reference's: beyond, it waits.
LEAD = 0.03
# Limits of the search for a start: solutions, seconds for each, precision [m].
SOLVE_STEPS, SOLVE_PERIOD, SOLVED = 200, 0.1, 1e-4


class CartesianController:
    """Follows tool points of one or more arms.

    Attributes:
        home: configuration (nq,) [rad] of the posture task.
        failures: number of times that no solution was found since the last reset; the arms then
            stood still.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        tools: Sequence[str],
        home: np.ndarray,
        velocity_limits: Mapping[str, float],
        shapes: Sequence[Sequence[int]] = (),
        floor: int | None = None,
        orientation_cost: float = ORIENTATION_COST,
    ):
        """Sets up the tasks; tools keep their orientation at home, unless commanded.

        Args:
            model: the arms alone, with nothing but their joints.
            tools: names of the sites to control, one for each arm.
            home: configuration (nq,) [rad] of the posture task.
            velocity_limits: largest speed [rad/s] of each joint by name.
            shapes: geoms of each arm; those of two arms keep apart.
            floor: geom from which all of these keep away.
            orientation_cost: cost of a radian [1/rad], where a meter costs 1.
        """
        low, high = model.jnt_range.T
        self._low, self._high = low + LIMIT_MARGIN, high - LIMIT_MARGIN
        self.home = np.array(home, float)
        self._configuration = Reference(model, self.home)
        self._sites = [model.site(name).id for name in tools]
        self.turn(self.rotations())
        self._frames = [
            ToolTask(name, "site", POSITION_COST, orientation_cost, lm_damping=TASK_DAMPING)
            for name in tools
        ]
        posture = mink.PostureTask(model, POSTURE_COST, gain=POSTURE_GAIN)
        posture.set_target(self.home)
        self._tasks = [Summed(task) for task in (*self._frames, posture)]
        self._angles = mink.PostureTask(model, cost=1.0)
        self._bending = [Summed(self._angles)]
        self._limits: list[mink.Limit] = [
            mink.ConfigurationLimit(model, gain=LIMIT_GAIN),
            mink.VelocityLimit(model, dict(velocity_limits)),
        ]
        if floor is not None:
            self._keep_apart(list(itertools.chain(*shapes)), [floor], FLOOR_CLEARANCE)
        if len(shapes) == 2:
            self._keep_apart(shapes[0], shapes[1], CLEARANCE)
        self._velocity = np.zeros(model.nv)
        self.failures = 0

    def _keep_apart(self, first: Sequence[int], second: Sequence[int], distance: float) -> None:
        self._limits.append(
            Clearance(
                self._configuration.model,
                [(first, second)],
                gain=APPROACH * PERIOD,  # mink divides the gain by the period.
                minimum_distance_from_collisions=distance,
                collision_detection_distance=distance + AWARE,
            )
        )

    @property
    def range(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest joint angles (nq,) [rad] of the reference."""
        return self._low, self._high

    @property
    def configuration(self) -> np.ndarray:
        """Joint angles (nq,) [rad] of the reference, a fresh array."""
        return self._configuration.q.copy()

    @property
    def velocity(self) -> np.ndarray:
        """Joint velocities (nq,) [rad/s] that led to the reference, a fresh array."""
        return self._velocity.copy()

    def points(self) -> np.ndarray:
        """Tool points (n, 3) [m] of the reference, a fresh array."""
        return self._configuration.data.site_xpos[self._sites]

    def rotations(self) -> np.ndarray:
        """Rotation matrices (n, 3, 3) of the reference's tools, a fresh array."""
        return self._configuration.data.site_xmat[self._sites].reshape(-1, 3, 3)

    def within_lead(self, points: np.ndarray) -> np.ndarray:
        """Returns commanded points (n, 3) [m], moved to within `LEAD` of the reference."""
        return drawn_in(points, self.points(), LEAD)

    def turn(self, rotations: np.ndarray) -> None:
        """Sets the commanded orientation of the tools, as matrices (n, 3, 3)."""
        self._rotations = [mink.SO3.from_matrix(rotation) for rotation in rotations]

    def reset(self, points: np.ndarray) -> None:
        """Puts the reference at rest with its tool points nearest to `points` (n, 3) [m]."""
        self._place(self.home)
        for _ in range(SOLVE_STEPS):
            self.follow_points(points, SOLVE_PERIOD)
            if np.abs(self._velocity).max() * SOLVE_PERIOD < SOLVED:
                break
        self._velocity[:] = 0.0
        self.failures = 0

    def follow_points(self, points: np.ndarray, duration: float = PERIOD) -> None:
        """Moves the reference for `duration` [s] so that its tool points reach `points` (n, 3) [m].

        Joint and speed limits may stop it before.
        """
        for frame, rotation, point in zip(self._frames, self._rotations, points, strict=True):
            frame.set_target(mink.SE3.from_rotation_and_translation(rotation, point))
        self._go(self._tasks, duration)

    def follow_joints(self, angles: np.ndarray) -> None:
        """Moves the reference for a period so that its joints reach `angles` (nq,) [rad].

        Joint and speed limits and the distances from the floor and other arms may stop it before.
        """
        self._angles.set_target(angles)
        self._go(self._bending, PERIOD)

    def _go(self, tasks: Sequence[Summed], duration: float) -> None:
        try:
            self._velocity = mink.solve_ik(
                self._configuration, tasks, duration, "daqp", DAMPING, limits=self._limits
            )
        except mink.NoSolutionFound:
            self._velocity = np.zeros_like(self._velocity)
            self.failures += 1
        self._place(self._configuration.integrate(self._velocity, duration))

    def _place(self, configuration: np.ndarray) -> None:
        # Outside the limits the program has no solution.
        self._configuration.update(np.clip(configuration, self._low, self._high))

    def get_state(self) -> dict[str, np.ndarray]:
        """Returns the reference, for snapshots."""
        return {
            "configuration": self.configuration,
            "velocity": self.velocity,
            "failures": np.array(self.failures),
        }

    def set_state(self, state: dict[str, np.ndarray]) -> None:
        """Restores the reference that `get_state` returned."""
        self._configuration.update(state["configuration"])
        self._velocity[:] = state["velocity"]
        self.failures = int(state["failures"])
