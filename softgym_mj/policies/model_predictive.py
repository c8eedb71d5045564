"""`ModelPredictivePolicy`: plans by sampling, executes the first actions, plans again."""

from collections.abc import Callable

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import check_count
from softgym_mj.policies.planners import CEM, Plan
from softgym_mj.policies.rollouts import Asking, Rollouts, answered
from softgym_mj.storage.journal import Journal

_SEED_KEY = 0x504C414E  # Keeps the planner's random numbers apart from those of variations.


class ModelPredictivePolicy:
    """CEM with true dynamics: a planner that simulates from the exact state what actions would do.

    What was decided can be kept in a journal, from which an interrupted episode goes on exactly:
    the random numbers of a decision depend on seed, variation and step alone.
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
            env: what it acts in.
            planner: how it plans.
            rollouts: plays sequences in copies of `env`.
            seed: of the samples.
            replan_every: env steps for which a plan is executed, at most the planner's horizon.
            journal: of the decisions of one episode of these settings.
            on_decision: called with every plan.

        Raises:
            InvalidArgumentError: if plans are executed for longer than they look ahead.
        """
        check_count("replan_every", replan_every, 1, planner.horizon)
        self._env, self._planner, self._rollouts = env, planner, rollouts
        self._seed, self._replan_every, self._journal = seed, replan_every, journal
        self._on_decision = on_decision
        self._decided: list[np.ndarray] = []

    def __call__(self, timestep: dm_env.TimeStep) -> np.ndarray:
        """The action for a time step of the environment."""
        (action,) = answered([self.act(timestep)], self._rollouts)
        return action

    def act(self, timestep: dm_env.TimeStep) -> Asking[np.ndarray]:
        """What a call returns, for whoever plays the samples of several policies together."""
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
