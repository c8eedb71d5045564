"""`Driving`: from the action of an env step to the motion in each physics step."""

from softgym_mj.exceptions import LifecycleError
from softgym_mj.robots.base import SIM_STEP, Actor


class Driving:
    """Commands an actor in env steps, plans in sim steps and moves it in physics steps."""

    def __init__(self, actor: Actor, timestep: float):
        """Binds an actor.

        Args:
            actor: the actor.
            timestep: physics step [s].
        """
        self._actor, self._timestep = actor, timestep
        self._parts = round(SIM_STEP / timestep)  # Physics steps in a sim step.
        self._count = 0  # Physics steps in this env step.

    def start(self, action: object, as_long_as_needed: bool) -> None:
        """Starts an env step.

        Args:
            action: action of the env step.
            as_long_as_needed: whether the env step has as many sim steps as the actor needs.

        Raises:
            InvalidArgumentError: for a bad action.
            LifecycleError: if the actor may need more sim steps than the env step has.
        """
        checked = self._actor.checked_action(action)
        if self._actor.sim_steps is not None and not as_long_as_needed:
            raise LifecycleError(
                "env steps of this actor differ in length: run the task in "
                "softgym_mj.envs.environment.Environment, or by softgym_mj.load"
            )
        self._actor.command(checked)
        self._count = 0

    def substep(self) -> None:
        """Moves the actor for the next physics step."""
        part = self._count % self._parts
        if part == 0:
            self._actor.plan()
        self._actor.move((part + 1) / self._parts, self._timestep)
        self._count += 1
