"""`Training`: soft actor-critics of several seeds learn a task side by side.

It may be killed at any time: it goes in parts, after each of which all of it is kept. Environments
begin anew at the start of a part, from seeds of the part's own: so what was killed goes on with the
same numbers.
"""

import csv
import dataclasses
import io
import pathlib
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError, StoreError, check_count
from softgym_mj.jobs.files import read_whole, write_whole
from softgym_mj.kinds import typed
from softgym_mj.learning.networks import drawn, generators
from softgym_mj.learning.replay import Replay
from softgym_mj.learning.sac import SAC, SACSettings
from softgym_mj.learning.symmetries import Symmetry, symmetries
from softgym_mj.registry import find
from softgym_mj.variations.indices import SPLITS

_PARTS = 1_000_003  # Keeps the seeds of environments of different parts apart.
COLUMNS = (
    "task", "method", "observation", "preset", "replay", "seed", "env_steps", "updates", "seconds",
    "split", "episodes", "normalized_performance", "success", "final",
)  # fmt: skip


@typed
@dataclasses.dataclass(frozen=True)
class TrainingSettings:
    """What is learned, and from how much.

    Attributes:
        task: its name.
        env_steps: of each seed, in all.
        worlds: environments of each seed.
        random_steps: env steps of each seed that are random, before it learns.
        updates: for each step of all environments.
        batch: env steps of an update, of each seed.
        replay: env steps of each seed that are kept.
        added: env steps whose rewards are added up.
        reward_scale: factor to rewards.
        symmetric: whether replays show the symmetries of the task.
        part: env steps of each seed between two checkpoints.
        evaluate_every: parts from an evaluation to the next; the last one is evaluated, too.
        episodes: of each split in an evaluation.
        final_episodes: held out, in the last one.
        fidelity: of the task.

    Raises:
        InvalidArgumentError: for numbers out of range.
    """

    task: str
    env_steps: int = 1_000_000
    worlds: int = 64
    random_steps: int = 1_000
    updates: int = 64
    batch: int = 128
    replay: int = 100_000
    added: int = 1
    reward_scale: float = 50.0
    symmetric: bool = False
    part: int = 50_000
    evaluate_every: int = 1
    episodes: int = 20
    final_episodes: int = 200
    fidelity: str = "default"

    def __post_init__(self):
        find(self.task)
        for name in ("env_steps", "worlds", "updates", "batch", "added", "evaluate_every"):
            check_count(name, getattr(self, name), 1)
        for name in ("episodes", "final_episodes"):
            check_count(name, getattr(self, name), 1, len(SPLITS["evaluate"]))
        for name in ("env_steps", "part", "replay"):
            if getattr(self, name) % self.worlds:
                raise InvalidArgumentError(
                    name, getattr(self, name), f"{self.worlds} times a number"
                )
        if self.env_steps % self.part:
            raise InvalidArgumentError("env_steps", self.env_steps, f"{self.part} times a number")

    @property
    def parts(self) -> int:
        """How many there are."""
        return self.env_steps // self.part


@dataclasses.dataclass
class Training:
    """A training in a folder.

    Attributes:
        settings, learner: what, and how.
        seeds: of trainings that go side by side.
        folder: where it is kept.
        device: of the environments ("cpu", "host" or "cuda"); the last one is the learner's, too.
        rows: the curve so far: by `COLUMNS`, one of each evaluation, seed and split.
        done: parts so far.
    """

    settings: TrainingSettings
    learner: SACSettings
    seeds: Sequence[int]
    folder: pathlib.Path
    device: str = "cpu"
    preset: str = "custom"
    rows: list[dict[str, Any]] = dataclasses.field(default_factory=list, init=False)
    done: int = dataclasses.field(default=0, init=False)

    def __post_init__(self):
        settings, self._seconds = self.settings, 0.0
        self._torch = "cuda" if self.device == "cuda" else "cpu"
        number = settings.worlds * len(self.seeds)
        self._envs = self._make(number, autoreset_mode="SameStep")
        observation, action = (
            space.shape[-1] for space in (self._envs.observation_space, self._envs.action_space)
        )
        self.sac = SAC(self.learner, self.seeds, observation, action, self._torch)
        shown: list[Symmetry] = []
        if settings.symmetric:
            env = softgym_mj.load(settings.task, split="all", **self._task_settings())
            env.reset(0)
            shown = symmetries(env)
        self._replay = Replay(
            settings.replay // settings.worlds, self.seeds, settings.worlds, observation, action,
            discount=self.learner.discount, steps=settings.added, symmetries=shown,
            device=self._torch,
        )  # fmt: skip
        self._noise = generators(self.seeds, "cpu")

    def _task_settings(self) -> dict[str, Any]:
        record = find(self.settings.task)
        return {"fidelity": self.settings.fidelity} if "fidelity" in record.arguments else {}

    def _make(self, number: int, **settings: Any) -> Any:
        return softgym_mj.make_vec(
            self.settings.task, number, device=self.device, observation="reduced",
            **self._task_settings(), **settings,
        )  # fmt: skip

    # ------------------------------------------------------------------ learning

    def run(self, progress: Callable[["Training"], None] = lambda training: None) -> None:
        """Trains to the end, from the last checkpoint if there is one.

        Args:
            progress: called after each part.

        Raises:
            StoreError: if the folder has a training of other settings.
        """
        self._restore()
        while self.done < self.settings.parts:
            start = time.perf_counter()
            self._learn()
            self.done += 1
            self._seconds += time.perf_counter() - start
            self._keep()  # Before an evaluation, which may fail.
            is_last = self.done == self.settings.parts
            if is_last or self.done % self.settings.evaluate_every == 0:
                self._evaluate(final=is_last)
                self._keep()
            progress(self)
        self._envs.close()

    def _learn(self) -> None:
        """One part."""
        settings, seeds = self.settings, self.seeds
        number = settings.worlds
        firsts = [(seed * _PARTS + self.done) * number for seed in seeds]
        each = [first + i for first in firsts for i in range(number)]
        seen, _ = self._envs.reset(seed=each, options={"stagger": True})
        observation = self._tensor(seen)
        steps = settings.part // number
        for k in range(steps):
            before = (self.done * settings.part + k * number) < settings.random_steps
            action = self._random_actions() if before else self._actions(observation)
            told = action if self.device == "cuda" else action.numpy()
            seen, rewards, terminated, truncated, infos = self._envs.step(told)
            following = self._tensor(seen)
            terminated, truncated = (torch.as_tensor(e) for e in (terminated, truncated))
            ended = terminated | truncated
            is_last = k == steps - 1
            self._replay.add(
                observation=observation, action=action,
                reward=settings.reward_scale * torch.as_tensor(rewards).float(),
                next_observation=self._last(following, infos), terminated=terminated,
                ended=ended | is_last,  # The next part begins elsewhere.
            )  # fmt: skip
            observation = following
            if not before and self._replay.size >= settings.added:
                for _ in range(settings.updates):
                    self.sac.update(self._replay.sample(settings.batch))

    def _tensor(self, seen: Any) -> Tensor:
        return torch.as_tensor(seen).float()

    def _last(self, following: Tensor, infos: Mapping[str, Any]) -> Tensor:
        """What was seen at the end of each episode, where one has ended: else what follows."""
        if "final_obs" not in infos:
            return following
        final, ended = infos["final_obs"], torch.as_tensor(infos["_final_obs"])
        if isinstance(final, Tensor):
            return torch.where(ended[:, None], final.float(), following)
        found = following.clone()
        for i in np.flatnonzero(ended.numpy()).tolist():
            found[i] = torch.as_tensor(final[i]).float()
        return found

    def _random_actions(self) -> Tensor:
        shape = self.settings.worlds, self._envs.action_space.shape[-1]
        numbers = drawn(self._noise, *shape, normal=False)
        return (2.0 * numbers - 1.0).flatten(0, 1).to(self._torch)

    def _actions(self, observation: Tensor, *, explore: bool = True) -> Tensor:
        own = observation.reshape(len(self.seeds), -1, observation.shape[-1])
        return self.sac.act(own, explore=explore).flatten(0, 1)

    # ------------------------------------------------------------------ evaluation

    def _evaluate(self, *, final: bool) -> None:
        """Plays variations of both splits with the mean actions, all held out ones in the end."""
        for split, indices in SPLITS.items():
            if split == "all":
                continue
            held_out = final and split == "evaluate"
            number = self.settings.final_episodes if held_out else self.settings.episodes
            chosen = indices[:: len(indices) // number][:number]
            scores = self.play(chosen)
            for k, seed in enumerate(self.seeds):
                self.rows.append(
                    {
                        "task": self.settings.task, "method": "sac", "observation": "reduced",
                        "preset": self.preset,
                        "replay": "symmetric" if self.settings.symmetric else "plain",
                        "seed": seed, "env_steps": self.done * self.settings.part,
                        "updates": self.sac.updates, "seconds": round(self._seconds, 1),
                        "split": split, "episodes": number,
                        "normalized_performance": float(scores["normalized_performance"][k].mean()),
                        "success": float(scores["success"][k].mean()), "final": int(final),
                    }
                )  # fmt: skip

    def play(self, variations: Sequence[int]) -> dict[str, np.ndarray]:
        """Plays an episode of each variation with the mean actions of each seed.

        Returns:
            Normalised performance and success (seeds, variations) at the end, by name.
        """
        number = len(variations) * len(self.seeds)
        envs = self._make(number, autoreset_mode="Disabled", split=variations)
        seen, _ = envs.reset(options={"variation": [*variations] * len(self.seeds)})
        ended = np.zeros(number, bool)
        while not ended.any():
            action = self._actions(self._tensor(seen), explore=False)
            told = action if self.device == "cuda" else action.numpy()
            seen, _, terminated, truncated, infos = envs.step(told)
            ended = np.asarray(torch.as_tensor(terminated | truncated).cpu())
        envs.close()
        shape = len(self.seeds), len(variations)
        return {
            name: torch.as_tensor(infos[name]).double().cpu().numpy().reshape(shape)
            for name in ("normalized_performance", "success")
        }

    # ------------------------------------------------------------------ checkpoints

    @property
    def _file(self) -> pathlib.Path:
        return self.folder / "checkpoint.pt"

    def _owner(self) -> dict[str, Any]:
        return {
            "settings": dataclasses.asdict(self.settings),
            "learner": dataclasses.asdict(self.learner),
            "seeds": list(self.seeds),
        }

    def _keep(self) -> None:
        """Writes a checkpoint and the curve: each whole or not at all."""
        state = {
            "owner": self._owner(),
            "sac": self.sac.get_state(),
            "replay": self._replay.get_state(),
            "noise": [source.get_state() for source in self._noise],
            "rows": self.rows,
            "done": self.done,
            "seconds": self._seconds,
        }
        file = io.BytesIO()
        torch.save(state, file)
        write_whole(self._file, file.getvalue())
        text = io.StringIO(newline="")
        writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.rows)
        write_whole(self.folder / "curve.csv", text.getvalue().encode())

    def _restore(self) -> None:
        if not self._file.exists():
            return
        state = torch.load(
            io.BytesIO(read_whole(self._file)), map_location=self._torch, weights_only=True
        )
        if state["owner"] != self._owner():
            raise StoreError(
                f"{self.folder} has a training of other settings: choose another folder"
            )
        self.sac.set_state(state["sac"])
        self._replay.set_state(state["replay"])
        for source, kept in zip(self._noise, state["noise"], strict=True):
            source.set_state(kept.cpu())
        self.rows, self.done = state["rows"], state["done"]
        self._seconds = state["seconds"]
