"""`TrainingSetup`: the parts of a training, and its card."""

import dataclasses
import pathlib
import platform
import time
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor

import softgym_mj
from softgym_mj.envs.load import horizon_of
from softgym_mj.exceptions import InvalidArgumentError, SoftGymError, UnavailableError
from softgym_mj.learning.exploring import Explorer, problem_of
from softgym_mj.learning.learner import Learner, Method, check_random_steps
from softgym_mj.learning.players import Players
from softgym_mj.learning.registry import METHODS, image_methods
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.symmetries import SYMMETRIC
from softgym_mj.learning.time_limits import TimeLimit
from softgym_mj.policies.exported import has_images
from softgym_mj.registry import find


def check_settings(settings: TrainingSettings, method: Method) -> None:
    """Checks settings of training and method together, without creating environments.

    Raises:
        InvalidArgumentError: if random steps leave none to learn from; for symmetric replay of a
            task without symmetries; for images with a method of states; for several observations
            with a method of one; without a teacher that a method needs.
    """
    if len(settings.observations) > 1 and not hasattr(method.settings, "privileged"):
        valid = f"a single name, as {method.name} takes one observation"
        raise InvalidArgumentError("observation", settings.observation, valid)
    if getattr(method.settings, "teacher", None) == "":
        valid = "--teacher FILE.pt2 or MODULE:FUNCTION, and --trust; teacher_student needs none"
        raise InvalidArgumentError("teacher", "", valid)
    if has_images(settings.observations) and method.name in METHODS:
        able = image_methods(settings.task)
        if method.name not in able:
            valid = f"a state with {method.name}; {', '.join(able)} learn from images"
            raise InvalidArgumentError("observation", settings.observation, valid)
    check_random_steps(method.settings, settings.env_steps, settings.num_envs)
    has_symmetries = bool(find(settings.task).resolve().symmetries)
    if getattr(method.settings, "symmetric", False) and not has_symmetries:
        raise InvalidArgumentError("task", settings.task, SYMMETRIC)


@dataclasses.dataclass
class TrainingSetup:
    """Environments, players, learner and progress of a training in a folder.

    Attributes:
        settings, method: Settings of the training, and the method.
        seeds: Seeds that are trained together.
        folder: Folder of checkpoints and results.
        device: Device of the environments: "cpu", "host" or "cuda".
        learner_device: Device of the networks: "cpu" or "cuda"; None for that of the environments.
        limit: Time limit.
        rows: Curve so far: entries by `curves.COLUMNS` of each evaluation, seed and split.
        done: Number of finished parts.
        end: Env steps of each seed at the end: `settings.env_steps`, fewer at the time limit.
        learner: The learner.
        phase: "starts", "starts a part", "repeats a part", "learns", "evaluates" or "ended".

    Raises:
        InvalidArgumentError: for settings by which nothing would be learned, or that need more
            memory than there is.
        UnavailableError: without the learner's device.
    """

    settings: TrainingSettings
    method: Method
    seeds: Sequence[int]
    folder: pathlib.Path
    device: str = "cpu"
    learner_device: str | None = None
    limit: TimeLimit = dataclasses.field(default_factory=TimeLimit)
    rows: list[dict[str, Any]] = dataclasses.field(default_factory=list, init=False)
    done: int = dataclasses.field(default=0, init=False)
    end: int = dataclasses.field(init=False)
    learner: Learner = dataclasses.field(init=False)
    phase: str = dataclasses.field(default="starts", init=False)

    def __post_init__(self):
        settings = self.settings
        check_settings(settings, self.method)
        self.end = settings.env_steps
        self._begun, self._before = time.perf_counter(), 0.0  # Start; seconds of earlier sessions.
        # Vector steps of the part so far, their actions (seeds, num_envs, n), and the learner's
        # memory.
        self._step, self._actions, self._memory = 0, list[Tensor](), None
        own = "cuda" if self.device == "cuda" else "cpu"
        if self.learner_device == "cuda" and not torch.cuda.is_available():
            raise UnavailableError("there is no CUDA device that PyTorch can use")
        number = settings.num_envs * len(self.seeds)
        left = {} if settings.learned_steps is None else {"horizon": settings.learned_steps}
        self._envs = self._make(number, autoreset_mode="SameStep", **left)
        self._horizon = horizon_of(settings.task, settings.task_settings)  # Of evaluations.
        at = self.learner_device or own
        self._problem = problem_of(settings, self.seeds, self._envs, at)
        self._explorer = Explorer(self._problem, self._envs, self.device)
        self._players = Players(
            self._problem,
            lambda number: self._make(number, autoreset_mode="Disabled", split="all"),
            self._explorer.env_actions,
        )
        try:
            self.learner = self.method.make(self.method.settings, self._problem)
        except SoftGymError:
            raise
        except (RuntimeError, MemoryError) as error:  # PyTorch runs out of memory.
            raise InvalidArgumentError(
                f"the networks or the replay of {self.method.name} cannot be created with these "
                f"settings: {error}"
            ) from error
        if not hasattr(self.learner, "policy"):  # A module of somebody made it.
            valid = "a softgym_mj.learning.learner.Learner"
            raise InvalidArgumentError(f"{self.method.name}()", self.learner, valid)

    def _make(self, number: int, **settings: Any) -> Any:
        own, observed = self.settings, self.settings.observed
        if (privileged := getattr(self.method.settings, "privileged", None)) is not None:
            names = [*dict.fromkeys([*own.observations, *privileged.split("+")])]
            if len(names) == 1:
                valid = f"another one than the teacher's, {privileged!r}"
                raise InvalidArgumentError("observation", own.observation, valid)
            observed["observation"] = names
        return softgym_mj.make_vec(
            own.task, number, device=self.device, **{**observed, **own.task_settings, **settings}
        )

    @property
    def env_steps(self) -> int:
        """Number of env steps of each seed so far, out of `settings.env_steps`."""
        return self.done * self.settings.part + self._step * self.settings.num_envs

    @property
    def seconds(self) -> float:
        """Wall-clock time so far [s], with start-up and evaluations."""
        return self._before + time.perf_counter() - self._begun

    def evaluations(self) -> list[int]:
        """Returns the env steps of each seed at which a complete curve has points."""
        settings = self.settings
        apart = settings.part * settings.evaluate_every
        return [*range(apart, self.end, apart), self.end]

    def evaluation_steps(self, episodes: int) -> float:
        """Returns the duration of an evaluation in vector steps; it plays both splits at once."""
        return self._horizon * max(1.0, 2 * episodes / self.settings.num_envs)

    def _owner(self) -> dict[str, Any]:
        return {
            "method": self.method.name,
            "training": dataclasses.asdict(self.settings),
            "settings": dataclasses.asdict(self.method.settings),
            "seeds": list(self.seeds),
        }

    def card(self) -> dict[str, Any]:
        """Returns the card of the training as JSON: settings, versions and last scores."""
        on = self._problem.device
        return {
            **self._owner(),
            "preset": self.method.preset,
            "evaluations": self.evaluations(),
            "env_steps": self.env_steps,
            "updates": self.learner.updates,
            "seconds": round(self.seconds, 1),
            "split": "train",
            "device": platform.machine() if on == "cpu" else torch.cuda.get_device_name(),
            "backend": self.device,
            "versions": {"softgym_mj": softgym_mj.__version__, "torch": torch.__version__},
            "last": [row for row in self.rows if row["env_steps"] == self.rows[-1]["env_steps"]],
        }
