"""mink's configuration, tasks and limits, with bit-identical sums on all processors.

They use `softgym_mj.native.arithmetic`. mink uses a task's objective directly if the task offers no
residual; its limits of joints and speeds have no matrix products.
"""

import mink
import mujoco
import numpy as np
from mink.tasks import BaseTask

from softgym_mj.native.arithmetic import product, squares


class Reference(mink.Configuration):
    """Configuration that leaves the Jacobians of frames to `ToolTask`."""

    def get_frame_jacobian(self, frame_name: str | int, frame_type: str) -> np.ndarray:
        """Returns the identity (6, 6): tasks multiply by it, which is exact in any order."""
        return np.eye(6)

    def site_jacobian(self, name: str) -> np.ndarray:
        """Returns the Jacobian (6, nv) of a site's linear and angular velocity in its frame."""
        site = self.model.site(name).id
        jacobian = np.empty((2, 3, self.nv))
        mujoco.mj_jacSite(self.model, self.data, jacobian[0], jacobian[1], site)
        return product(self.data.site_xmat[site].reshape(3, 3).T, jacobian).reshape(6, -1)


class ToolTask(mink.FrameTask):
    """Task that moves a site of a `Reference` to a target pose."""

    def compute_jacobian(self, configuration: mink.Configuration) -> np.ndarray:
        """Returns the Jacobian (6, nv) of the error.

        Raises:
            TargetNotSet: if there is no target yet.
        """
        assert isinstance(configuration, Reference)
        by_twist = super().compute_jacobian(configuration)
        return product(by_twist, configuration.site_jacobian(str(self.frame_name)))


class Summed(BaseTask):
    """mink task that sums its own objective, with the same bits on every processor."""

    def __init__(self, task: mink.Task):
        """Wraps a task, whose targets and costs may change afterwards."""
        self._task = task

    def compute_qp_objective(self, configuration: mink.Configuration) -> mink.Objective:
        """Returns the matrix (nv, nv) and vector (nv,) of the quadratic program."""
        task = self._task
        error = task.cost * (-task.gain * task.compute_error(configuration))
        jacobian = task.cost[:, None] * task.compute_jacobian(configuration)
        matrix = product(jacobian.T, jacobian)
        matrix.flat[:: configuration.nv + 1] += task.lm_damping * squares(error)
        return mink.Objective(matrix, -product(jacobian.T, error))


class Clearance(mink.CollisionAvoidanceLimit):
    """Limit that keeps geoms apart."""

    def compute_qp_inequalities(
        self, configuration: mink.Configuration, dt: float
    ) -> mink.Constraint:
        """Returns a matrix (pairs, nv) and bounds (pairs,), infinite for distant pairs."""
        constraint = super().compute_qp_inequalities(configuration, dt)
        assert constraint.G is not None and constraint.h is not None
        for i in np.flatnonzero(np.isfinite(constraint.h)):
            constraint.G[i] = self._approach(configuration, *self.geom_id_pairs[i])
        return constraint

    def _approach(self, configuration: mink.Configuration, first: int, second: int) -> np.ndarray:
        """Returns how fast two geoms approach with each joint (nv,) [m/rad]."""
        model, data, ends = configuration.model, configuration.data, np.empty(6)
        limit = self.collision_detection_distance
        distance = mujoco.mj_geomDistance(model, data, first, second, limit, ends)
        normal = ends[3:] - ends[:3]
        mujoco.mju_normalize3(normal)
        jacobians = np.empty((2, 3, configuration.nv))
        bodies = model.geom_bodyid
        mujoco.mj_jac(model, data, jacobians[0], None, ends[:3], bodies[first])
        mujoco.mj_jac(model, data, jacobians[1], None, ends[3:], bodies[second])
        towards = product((jacobians[0] - jacobians[1]).T, normal)
        return towards if distance >= 0.0 else -towards
