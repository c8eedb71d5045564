"""`ModelPredictivePolicy`: plans by sampling, executes the first actions and replans."""

from collections.abc import Callable

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import check_count
from softgym_mj.policies.planners import CEM, Plan
from softgym_mj.policies.rollouts import Asking, Rollouts, answered
from softgym_mj.storage.journal import Journal
from softgym_mj.validation import check_type

_SEED_KEY = 0x504C414E  # Separates the planner's random numbers from those of variations.


class ModelPredictivePolicy:
    """Model-predictive control with the true dynamics: samples are simulated from the exact state.

    An interrupted episode continues exactly from a journal of its decisions: their random numbers
    depend on seed, variation and step alone.
    """

    def __init__(
        self,
        env: Environment,
        planner: CEM,
        rollouts: Rollouts,
        *,
        seed: int = 0,
        replan_every: int = 1,
        journal: Journal | None = None,
        on_decision: Callable[[Plan], None] = lambda plan: None,
    ):
        """Binds the policy.

        Args:
            env: Environment of the policy.
            planner: The planner.
            rollouts: Plays sequences in copies of `env`.
            seed: Seed of the samples.
            replan_every: Env steps between two plans, at most the planner's horizon.
            journal: Journal of the decisions of one episode.
            on_decision: Called with every plan.

        Raises:
            InvalidArgumentError: if `replan_every` exceeds the horizon, or for another environment
                than one of `load`.
        """
        check_type("env", env, Environment)
        check_count("replan_every", replan_every, 1, planner.horizon)
        self._env, self._planner, self._rollouts = env, planner, rollouts
        self._seed, self._replan_every, self._journal = seed, replan_every, journal
        self._on_decision = on_decision
        self._decided: list[np.ndarray] = []

    def __call__(self, timestep: dm_env.TimeStep) -> np.ndarray:
        """Returns the action for a time step of the environment."""
        (action,) = answered([self.act(timestep)], self._rollouts)
        return action

    def act(self, timestep: dm_env.TimeStep) -> Asking[np.ndarray]:
        """Returns the action like a call, but yields its trials to a caller that plays them."""
        if timestep.first():
            written = [] if self._journal is None else self._journal.read()
            self._decided = [np.array(actions) for actions in written]
        decision, step = divmod(self._env.step_count, self._replan_every)
        if decision == len(self._decided):
            plan = yield from self._plan()
            self._decided.append(plan.actions)
            if self._journal is not None:
                self._journal.append(plan.actions.tolist())
            self._on_decision(plan)
        return self._decided[decision][step]

    def _plan(self) -> Asking[Plan]:
        env, size = self._env, self._env.task.actor.action_size
        if self._decided:
            guess = self._planner.shifted(self._decided[-1], self._replan_every)
        else:
            guess = self._planner.first_guess(size)
        random = np.random.default_rng([_SEED_KEY, self._seed, env.task.variation, env.step_count])
        snapshot = env.get_state()
        search = self._planner.search(guess, random)
        samples = next(search)
        while True:
            returns = yield snapshot, samples
            try:
                samples = search.send(returns)
            except StopIteration as end:
                return end.value
