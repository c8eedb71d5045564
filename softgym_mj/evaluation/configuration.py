"""Configuration of an evaluation: task, policy, variations, seeds, settings."""

import dataclasses
import importlib.metadata
import json
import platform
from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from softgym_mj import registry
from softgym_mj.exceptions import InvalidArgumentError, check_count
from softgym_mj.policies.exported import observes
from softgym_mj.policies.factory import SIMPLE, depends_on_seed
from softgym_mj.policies.planners import BUDGET, CEM, ITERATIONS, PLANNERS, make_planner
from softgym_mj.policies.saved import SEED, is_saved, sha256
from softgym_mj.validation import typed
from softgym_mj.variations.indices import check_settings, check_variation

# Increases when scores of the same episode change; results of different versions are not mixed.
PROTOCOL = 1
POLICIES = (*SIMPLE, *PLANNERS)


@typed
@dataclasses.dataclass(frozen=True)
class Planning:
    """Settings of a planner of `policies.planners`.

    Attributes:
        horizon: Planning horizon in env steps; None for the task's.
        budget: Simulated env steps per decision.
        iterations: Number of times that the distribution of samples is fitted.
        replan_every: Env steps between two plans.
    """

    horizon: int | None = None
    budget: int = BUDGET
    iterations: int = ITERATIONS
    replan_every: int = 1

    def planner(self, name: str, task: str) -> CEM:
        """Returns a planner, one of `PLANNERS`, for a task."""
        limits = {"budget": self.budget, "iterations": self.iterations}
        return make_planner(name, task, self.horizon, **limits)


@typed
@dataclasses.dataclass(frozen=True)
class Configuration:
    """Configuration of an evaluation.

    Attributes:
        task: Task name, as in `registry.find`.
        policy: One of `POLICIES`, or a file or function, as in `policies.factory.make_policy`.
        variations: Indices of the variations.
        seeds: Seeds of the policy; one, unless the policy depends on a seed.
        settings: Keyword arguments of the task that JSON can hold, such as actor and fidelity. The
            default of `observation` is that of the policy's file, otherwise "reduced".
        planning: Settings of a planner; None for other policies.
    """

    task: str
    policy: str
    variations: tuple[int, ...]
    seeds: tuple[int, ...] = (0,)
    settings: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    planning: Planning | None = None

    def __post_init__(self):
        registry.find(self.task)
        if not is_saved(self.policy) and self.policy not in POLICIES:
            choices = (*POLICIES, "FILE.pt2", "MODULE:FUNCTION")
            raise InvalidArgumentError("policy", self.policy, choices)
        for variation in self.variations:
            check_variation(variation)
        for name, values in (("variations", self.variations), ("seeds", self.seeds)):
            check_count(f"number of {name}", len(values), 1)
            if len(set(values)) != len(values):
                raise InvalidArgumentError(name, values, "distinct values")
        if len(self.seeds) > 1 and not depends_on_seed(self.policy):
            valid = f"1, as {self.policy!r} is the same policy for every seed; saved ones depend "
            valid += f"on it by FILE{SEED}.pt2 or by an argument `seed` of the FUNCTION"
            raise InvalidArgumentError("number of seeds", len(self.seeds), valid)
        check_settings(self.settings)
        self._observe()
        if self.policy in PLANNERS:
            planning = self.planning or Planning()
            horizon = planning.planner(self.policy, self.task).horizon
            planning = dataclasses.replace(planning, horizon=horizon)
            object.__setattr__(self, "planning", planning)
            check_count("replan_every", planning.replan_every, 1, horizon)
        elif self.planning is not None:
            names = (field.name for field in dataclasses.fields(Planning))
            raise InvalidArgumentError(
                f"planning is for {', '.join(PLANNERS)}, not for {self.policy!r}: leave out "
                f"{', '.join(names)}"
            )

    def _observe(self) -> None:
        """Sets the observation to that of the policies' files."""
        for seed in self.seeds:
            for name, value in observes(self.policy.replace(SEED, str(seed))).items():
                if (given := self.settings.get(name, value)) != value:
                    valid = f"{value!r}, with which {self.policy!r} was trained"
                    raise InvalidArgumentError(f"settings: {name}", given, valid)
                object.__setattr__(self, "settings", {**self.settings, name: value})

    @property
    def episodes(self) -> list[tuple[int, int]]:
        """Pairs (variation, seed) of all episodes."""
        return [(variation, seed) for seed in self.seeds for variation in self.variations]

    def as_json(self) -> dict[str, Any]:
        """Returns all that the scores depend on, with the SHA-256 of the policy's files.

        Raises:
            StoreError: if a file of the policy cannot be read.
        """
        hashes: dict[str, str] = {}
        if is_saved(self.policy):
            for seed in self.seeds:
                hashes |= sha256(self.policy, seed)
        return {
            "protocol": PROTOCOL,
            "task": self.task,
            "policy": self.policy,
            "policy_sha256": hashes,
            "variations": list(self.variations),
            "seeds": list(self.seeds),
            "settings": json.loads(json.dumps(dict(self.settings))),  # JSON has no tuples.
            "planning": None if self.planning is None else dataclasses.asdict(self.planning),
            "versions": {
                "softgym_mj": importlib.metadata.version("softgym_mj"),
                "mujoco": mujoco.__version__,
                "numpy": np.__version__,
                "python": platform.python_version(),
            },
        }
