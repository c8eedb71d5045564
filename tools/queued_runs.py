"""Queue of the runs behind the published results."""

import dataclasses
import json
import pathlib
import shlex
import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from softgym_mj.exceptions import InvalidArgumentError, StoreError, check_count, check_name
from softgym_mj.learning.curves import DEFAULT_ACTOR
from softgym_mj.learning.registry import METHODS, find_preset
from softgym_mj.learning.results import Row
from softgym_mj.policies.planners import PLANNERS
from softgym_mj.registry import TASKS
from softgym_mj.storage.files import naming, read_whole
from softgym_mj.validation import typed
from softgym_mj.variations.indices import SPLITS
from softgym_mj.vector.make import DEVICES


@typed
@dataclasses.dataclass(frozen=True)
class QueuedRun:
    """Entry of queue.toml.

    Attributes:
        task, actor, method, observation, preset, replay: Fields of `learning.results.Name`.
        seeds: Number of seeds, 0..seeds - 1.
        why: Purpose of the run.
        settings: Values of --settings; options of `evaluate` for a planner.
        teacher: Teacher of distill: a name in docs/results/policies, or "module:function".
        env_steps: Env steps that a planner simulates in an episode.
        episodes: Number of held-out episodes of the last evaluation.
        device: Device of the training.
        gpu_minutes, core_hours: Estimated cost of all seeds; one of them.
    """

    task: str
    method: str
    preset: str
    seeds: int
    why: str
    actor: str = DEFAULT_ACTOR
    observation: str = "reduced"
    replay: str = "plain"
    settings: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    teacher: str | None = None
    env_steps: int | None = None
    episodes: int = len(SPLITS["evaluate"])
    device: str = "cuda"
    gpu_minutes: float | None = None
    core_hours: float | None = None

    def __post_init__(self):
        check_name("task", self.task, TASKS)
        if ":" not in self.method:
            check_name("method", self.method, (*METHODS, *PLANNERS, "MODULE:FUNCTION"))
        check_name("device", self.device, DEVICES)
        check_count("seeds", self.seeds, 1, 100)
        check_count("episodes", self.episodes, 1, len(SPLITS["evaluate"]))
        if (self.gpu_minutes is None) == (self.core_hours is None):
            raise InvalidArgumentError(
                "gpu_minutes", self.gpu_minutes, "or core_hours, one of them"
            )

    @property
    def plans(self) -> bool:
        """Whether it is an evaluation of a planner."""
        return self.method in PLANNERS

    @property
    def cost(self) -> str:
        """Estimated cost, in words."""
        minutes, hours = self.gpu_minutes, self.core_hours
        return f"{hours:g} core h" if minutes is None else f"{minutes:g} GPU min"

    @property
    def _actor(self) -> list[str]:
        """Name of the actor unless it is the default."""
        return [self.actor] if self.actor != DEFAULT_ACTOR else []

    @property
    def folder(self) -> str:
        """Output folder of `command`."""
        return shlex.split(self.command)[-1]

    @property
    def command(self) -> str:
        """Command line of the run."""
        parts = [self.task, *self._actor, self.method, self.observation, self.preset, self.replay]
        where = ["--device", self.device, "--out", f"training/{'-'.join(parts)}"]
        if self.plans:
            own = ["evaluate", self.task, "--policy", self.method, "--episodes", self.episodes]
            own += [word for actor in self._actor for word in ("--actor", actor)]
            for name, value in self.settings.items():
                own += [f"--{name.replace('_', '-')}", value]
                where[-1] += f"-{name}-{value}"
        else:
            own = ["train", self.method, self.task, "--preset", self.preset, "--seeds", self.seeds]
            if self.teacher:
                own += ["--teacher", self.teacher, *(() if ":" in self.teacher else ("--trust",))]
            for actor in self._actor:
                own += ["--task-settings", json.dumps({"actor": actor})]
            if self.settings:
                own += ["--settings", json.dumps(dict(self.settings))]
                where[-1] += f"-{'-'.join(self.settings)}"
        return shlex.join(map(str, ["softgym-mj", *own, *where]))

    def is_done(self, rows: Iterable[Row]) -> bool:
        """Returns whether `rows` has final rows of all seeds with the same held-out episodes.

        Env steps are compared if the entry sets them or replaces settings of the preset.
        """
        preset, env_steps = self.preset, self.env_steps
        if self.settings and self.plans:
            preset = "small"
        elif self.settings:
            training, method = find_preset(self.method, preset, self.task, **self.settings)
            preset = method.preset
            env_steps = training.env_steps if preset == "custom" else env_steps
        name = self.task, self.actor, self.method, self.observation, preset, self.replay
        result = {
            row.seed
            for row in rows
            if row.final and row.split == "evaluate" and row.name == name
            if env_steps in (None, row.env_steps) and row.episodes >= self.episodes
        }
        return result >= set(range(self.seeds))


def read_queue(file: pathlib.Path) -> list[QueuedRun]:
    """Returns the runs of a queue.toml, in order.

    Raises:
        StoreError: for an invalid file; the message names the entry and the value.
    """
    with naming(file, "read"):
        entries = tomllib.loads(read_whole(file).decode()).get("run", [])
    runs = []
    for number, entry in enumerate(entries, 1):
        try:
            runs.append(QueuedRun(**entry))
        except (TypeError, InvalidArgumentError) as error:
            raise StoreError(f"{file}, run {number}: {error}") from error
    return runs
