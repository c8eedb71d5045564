"""`Training`: trains policies of several seeds together, by any method.

A training is divided into parts, at whose start environments reset with seeds of the part. A
checkpoint is written at the end of each part, and periodically within one. The latter includes the
actions of the part so far, which are repeated when the training continues, so that an interrupted
training gives exactly the same result.
"""

import functools
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.learning.checkpoints import (
    alone,
    differences,
    moved,
    read_checkpoint,
    refused,
    with_env_steps,
    write_checkpoint,
)
from softgym_mj.learning.curves import (
    CARD,
    DEFAULT_ACTOR,
    POLICY,
    curve_rows,
    evaluated,
    named,
    write_curve,
    write_episodes,
)
from softgym_mj.learning.learner import UnexportableError
from softgym_mj.learning.setup import TrainingSetup
from softgym_mj.policies.exported import export_policy
from softgym_mj.storage.files import write_json, write_whole

# Minimum interval of checkpoints within a part [s], also as a multiple of the time to write one:
# checkpoints of images have gigabytes.
KEEP_SECONDS, KEEP_RATIO = 60.0, 50.0


class Training(TrainingSetup):
    """A training in a folder that runs, and continues from its last checkpoint.

    It is made of the arguments of `TrainingSetup`, and has its attributes.
    """

    def __post_init__(self):
        super().__post_init__()
        self._due = time.monotonic() + KEEP_SECONDS  # Time of the next checkpoint within a part.

    # ------------------------------------------------------------------ learning

    def run(
        self,
        progress: Callable[["Training", dict], None] = lambda training, news: None,
        on_start: Callable[["Training"], None] = lambda training: None,
        points: int = 0,
    ):
        """Trains to the end or the time limit, from the last checkpoint if there is one.

        At the time limit, the final evaluation and the policies are those of the env steps reached.
        The checkpoint omits this evaluation, so that the training continues as if uninterrupted.

        Args:
            progress: Called after each part with the training, losses and other metrics (seeds,) by
                name, and the mean score of exploration episodes since the last call.
            on_start: Called after the last checkpoint, if any, has been read.
            points: Number of further calls of `progress` in a whole training.

        Raises:
            StoreError: if the folder has a training of other settings, a running training or a
                damaged checkpoint.
        """
        torch.set_float32_matmul_precision("high")  # TF32 on a GPU; no effect on a CPU.
        with alone(self.folder):
            self._restore()
            on_start(self)
            self._catch_up()
            while self.env_steps < self.end:
                news = self._learn(functools.partial(progress, self), points)
                self._keep()  # The following evaluation may fail.
                if self._is_over():
                    self._end_early()
                else:
                    self._catch_up()
                progress(self, self._as_lists(news))
            self._export()
        self.phase = "ended"
        self._envs.close()
        self._players.close()

    def _catch_up(self) -> None:
        """Evaluates at the end of a part if an evaluation is due and missing."""
        is_last = self.env_steps == self.end
        if self.env_steps not in self.evaluations():
            return
        rows = [row for row in self.rows if row["env_steps"] == self.env_steps]
        if not rows or (is_last and not rows[0]["final"]):
            self._evaluate(final=is_last)
            self._keep()

    def _end_early(self) -> None:
        """Ends the training at the env steps reached; the checkpoint remains as it is."""
        self.end = self.env_steps
        self._evaluate(final=True)
        self._write_results()

    def _is_over(self) -> bool:
        """Returns whether the time that is left is needed for evaluations."""
        if self.env_steps == self.settings.env_steps:
            return False
        episodes = [self.settings.final_episodes]
        if self.env_steps in self.evaluations():
            episodes.append(self.settings.episodes)
        return self.limit.is_over(map(self.evaluation_steps, episodes))

    def _learn(
        self, progress: Callable[[dict], None] = lambda news: None, points: int = 0
    ) -> dict[str, Tensor]:
        """Trains to the end of a part or the time limit; returns the last metrics."""
        settings, news = self.settings, dict[str, Tensor]()
        steps = settings.part // settings.num_envs
        self.phase = "repeats a part" if self._actions else "starts a part"
        observation, first = self._explorer.begin(self.done, self._actions)
        self.phase = "learns"
        while self._step < steps:
            is_last = self._step == steps - 1
            with self.limit.timed():
                action, self._memory = self.learner.act(
                    observation, first, self._memory, explore=True
                )
                step, observation, first = self._explorer.step(observation, action, is_last)
            self._actions.append(action)
            news = self.learner.learn(step) or news
            self._step += 1
            before = (self.env_steps - settings.num_envs) * points // settings.env_steps
            if self._step < steps and before < self.env_steps * points // settings.env_steps:
                progress(self._as_lists(news))
            if self._step < steps and self._is_over():
                return news
            if self._step < steps and time.monotonic() > self._due:
                self._keep()
        self.done, self._step, self._actions, self._memory = self.done + 1, 0, [], None
        return news

    def _as_lists(self, news: Mapping[str, Tensor]) -> dict[str, list[float]]:
        """Returns metrics as lists, with scores of episodes since the last call."""
        result = {**news, **self._explorer.scores()}
        return {name: value.tolist() for name, value in result.items()}

    # ------------------------------------------------------------------ evaluation

    def _evaluate(self, *, final: bool) -> None:
        """Evaluates the policies on variations of both splits; `final` evaluations have more."""
        self.phase = "evaluates"
        settings = self.settings
        chosen = evaluated(settings.final_episodes if final else settings.episodes)
        is_symmetric = getattr(self.method.settings, "symmetric", False)
        self.rows = [row for row in self.rows if row["env_steps"] != self.env_steps]
        scores = self.play([index for each in chosen.values() for index in each])
        for split, indices in chosen.items():
            first = len(chosen["train"]) if split == "evaluate" else 0
            result = {name: each[:, first : first + len(indices)] for name, each in scores.items()}
            if final and split == "evaluate":
                write_episodes(self.folder, self.seeds, indices, result)
            common = {
                "task": settings.task, "actor": settings.actor or DEFAULT_ACTOR,
                "method": self.method.name,
                "observation": named(settings.observations), "preset": self.method.preset,
                "replay": "symmetric" if is_symmetric else "plain",
                "env_steps": self.env_steps, "updates": self.learner.updates,
                "seconds": round(self.seconds, 1), "split": split, "final": int(final),
            }  # fmt: skip
            self.rows += curve_rows(common, self.seeds, result)

    def play(self, variations: Sequence[int]) -> dict[str, np.ndarray]:
        """Plays an episode of each variation with the deterministic actions of each seed.

        Returns:
            Infos (seeds, variations) at the end of episodes, by name.
        """
        act = functools.partial(self.learner.act, explore=False)
        return self._players.play(variations, act)

    # ------------------------------------------------------------------ checkpoints

    def _keep(self) -> None:
        """Writes checkpoint, card and curve, each atomically."""
        start = time.monotonic()
        part = {"steps": self._step, "memory": moved(self._memory, "cpu")}
        if self._actions:
            part["actions"] = torch.stack(self._actions).cpu()
        state = {
            "owner": self._owner(), "learner": self.learner.get_state(), "rows": self.rows,
            "done": self.done, "part": part, "seconds": self.seconds,
        }  # fmt: skip
        write_checkpoint(self.folder, state)
        self._write_results()
        now = time.monotonic()
        self._due = now + max(KEEP_SECONDS, KEEP_RATIO * (now - start))

    def _write_results(self) -> None:
        """Writes card and curve, each atomically."""
        write_curve(self.folder, self.rows)
        write_json(self.folder / CARD, self.card())

    def _export(self) -> None:
        """Writes the policy of each seed to a file, for `softgym-mj evaluate --policy`."""
        space, names = self._envs.single_observation_space, self.settings.observations
        several: dict[str, Any] = getattr(space, "spaces", {names[0]: space})
        acting = {} if self.settings.actor is None else {"actor": self.settings.actor}
        observed = {**self.settings.observed, **acting}
        for k, seed in enumerate(self.seeds):
            try:
                module = self.learner.policy(k)
            except UnexportableError:
                return
            frames = getattr(module, "frames", 1)
            seen = {name: several[name] for name in names}
            saved = export_policy(module, seen, observed, frames, self.settings.task)
            write_whole(self.folder / POLICY.format(seed=seed), saved)

    def _restore(self) -> None:
        """Restores the last checkpoint, if there is one."""
        state = read_checkpoint(self.folder)
        if state is None:
            return
        owner = with_env_steps(state["owner"], self.settings.env_steps)
        if result := differences(owner, self._owner()):
            raise StoreError(
                f"{self.folder} has a training of other settings ({result}): choose another folder"
            )
        part, device = state["part"], self._problem.device
        try:
            self.learner.set_state(state["learner"])
            self.rows, self.done = state["rows"], state["done"]
            if owner != state["owner"]:  # The former end becomes a point of the curve, if any.
                points = {*self.evaluations()}
                self.rows = [row | {"final": 0} for row in self.rows if row["env_steps"] in points]
            self._step, self._memory = part["steps"], moved(part["memory"], device)
            self._actions = list(part["actions"].to(device)) if "actions" in part else []
        except (RuntimeError, LookupError, TypeError, ValueError, AttributeError) as error:
            raise refused(self.folder, str(error)) from error
        if self.env_steps > self.settings.env_steps:
            least = -(-self.env_steps // self.settings.part) * self.settings.part
            valid = f"{least} or more, because {self.folder} has {self.env_steps} env steps"
            raise InvalidArgumentError("env_steps", self.settings.env_steps, valid)
        self._before = state["seconds"]
