"""`ModelPredictivePolicy`: plans by sampling, executes the first actions, plans again."""

import json
import os
import pathlib
from collections.abc import Callable

import dm_env
import numpy as np

from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import StoreError, check_count
from softgym_mj.policies.planners import CEM, Plan
from softgym_mj.policies.rollouts import Rollouts

_SEED_KEY = 0x504C414E  # Keeps the planner's random numbers apart from those of variations.


class ModelPredictivePolicy:
    """The dynamics oracle: it knows the whole state and simulates what would happen.

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
        journal: pathlib.Path | None = None,
        on_decision: Callable[[Plan], None] = lambda plan: None,
    ):
        """Binds the policy.

        Args:
            env: what it acts in.
            planner: how it plans.
            rollouts: plays sequences in copies of `env`.
            seed: of the samples.
            replan_every: env steps for which a plan is executed, at most the planner's horizon.
            journal: file with one line a decision, for one episode.
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
        if timestep.first():
            self._decided = self._written()
        decision, step = divmod(self._env.step_count, self._replan_every)
        if decision == len(self._decided):
            plan = self._plan()
            self._decided.append(plan.actions)
            self._write(plan.actions)
            self._on_decision(plan)
        return self._decided[decision][step]

    def _plan(self) -> Plan:
        env, size = self._env, self._env.task.actor.action_size
        if self._decided:
            guess = self._planner.shifted(self._decided[-1], self._replan_every)
        else:
            guess = self._planner.first_guess(size)
        random = np.random.default_rng([_SEED_KEY, self._seed, env.task.variation, env.step_count])
        snapshot = env.get_state()
        return self._planner.plan(
            lambda sequences: self._rollouts.returns(snapshot, sequences), guess, random
        )

    def _written(self) -> list[np.ndarray]:
        """The decisions in the journal; a last line that was not finished is cut off."""
        if self._journal is None or not self._journal.exists():
            return []
        shape = self._planner.horizon, self._env.task.actor.action_size
        content = self._journal.read_bytes()
        whole = content[: content.rfind(b"\n") + 1]
        if whole != content:
            self._journal.write_bytes(whole)
        decided = []
        for line in whole.splitlines():
            try:
                actions = np.array(json.loads(line), float)
            except ValueError as error:
                raise StoreError(f"{self._journal} is damaged: {error}; delete it") from error
            if actions.shape != shape:
                raise StoreError(
                    f"{self._journal} has plans of shape {actions.shape}, expected {shape}: it is "
                    "of other settings; delete it"
                )
            decided.append(actions)
        return decided

    def _write(self, actions: np.ndarray) -> None:
        if self._journal is not None:
            self._journal.parent.mkdir(parents=True, exist_ok=True)
            with open(self._journal, "a") as file:
                file.write(json.dumps(actions.tolist()) + "\n")  # repr of floats is exact.
                file.flush()
                os.fsync(file.fileno())
