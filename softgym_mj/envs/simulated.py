"""`SimulatedEnvironment`: composer's environment with this package's physics and cameras."""

import numpy as np
from dm_control import composer

from softgym_mj.exceptions import LifecycleError
from softgym_mj.rendering.calibration import Calibration
from softgym_mj.rendering.framebuffer import SizedPhysics
from softgym_mj.rendering.observables import blank_images

NOMINAL_RATE = 2.5  # [1/s] Of env steps of pick and place, which take 0.3 to 0.5 s.


class SimulatedEnvironment(composer.Environment):
    """Compiles `SizedPhysics`, which keeps its OpenGL context, and simulates sim steps."""

    def _recompile_physics(self):
        # As in the base class, except for the class of physics, whose OpenGL context is kept.
        previous = getattr(self, "_physics", None)
        self._physics = SizedPhysics.from_mjcf_model(self._task.root_entity.mjcf_model)
        self._physics.legacy_step = self._legacy_step
        if previous:
            previous.free_for(self._physics)

    def _recompile_physics_and_update_observables(self):
        with blank_images():
            super()._recompile_physics_and_update_observables()
        self._model, self._data = self._physics.model.ptr, self._physics.data.ptr
        found = self._task.observables.values()  # It takes long to collect them.
        self._images = [image for image in found if hasattr(image, "views")]

    def _substep(self, action):
        for _ in range(self._task.actor.sim_steps or 1):  # Some actors need many for an action.
            super()._substep(action)

    def cameras(self) -> dict[str, Calibration]:
        """Returns the calibrations of the observed cameras by name, at their current poses."""
        views = (view for image in self._images if image.enabled for view in image.views)
        return {view.camera: view.calibration(self._physics) for view in views}

    @property
    def frame_rate(self) -> float:
        """Env steps per second of simulated time; nominal where they take as long as needed."""
        lasts = self._task.actor.sim_steps is not None
        return NOMINAL_RATE if lasts else 1.0 / self.control_timestep()

    def close(self) -> None:
        """Frees the simulation; does nothing after the first call."""
        if self._physics is not None:
            super().close()

    def _check_open(self) -> None:
        if self._physics is None:
            raise LifecycleError("this environment was closed: make a new one")

    def observation(self) -> dict[str, np.ndarray]:
        """Returns the current observation (of `observation_spec()`), as after `set_state`."""
        self._check_open()
        return self._observation_updater.get_observation()
