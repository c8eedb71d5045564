"""Published results: rows of curves, in one file."""

import csv
import dataclasses
import io
import math
import pathlib
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np

from softgym_mj.envs.load import horizon_of
from softgym_mj.evaluation.comparison import read_results
from softgym_mj.evaluation.configuration import Planning
from softgym_mj.exceptions import StoreError
from softgym_mj.learning.curves import COLUMNS, DEFAULT_ACTOR, FILE
from softgym_mj.policies.planners import PLANNERS
from softgym_mj.registry import TASKS
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.storage.files import naming, read_whole, write_csv
from softgym_mj.variations.indices import SPLITS

_T = TypeVar("_T")
_Parser = tuple[Callable[[str], Any], str]  # Parser of a value, and a description of valid text.


class Name(NamedTuple):
    """Name of a result: trainings of the same name differ only in their seeds."""

    task: str
    actor: str
    method: str
    observation: str
    preset: str
    replay: str


@dataclasses.dataclass(frozen=True)
class Row:
    """Evaluation of a seed on a split.

    Attributes:
        task, actor, method, observation, preset, replay: Fields of `Name`.
        seed: Seed of the training.
        env_steps: Env steps of training; for a planner, those that it simulates in an episode.
        updates: Updates so far.
        seconds: Wall-clock time so far, of all seeds that are trained together, with start-up and
            evaluations; None if not measured.
        split: "train", or "evaluate" (held out).
        episodes: Number of episodes of the evaluation.
        normalized_performance, success: Means at the end of episodes.
        final: Whether it belongs to the last checkpoint.
    """

    task: str
    actor: str
    method: str
    observation: str
    preset: str
    replay: str
    seed: int
    env_steps: int
    updates: int
    seconds: float | None
    split: str
    episodes: int
    normalized_performance: float
    success: float
    final: bool

    @property
    def name(self) -> Name:
        """Name of the result."""
        return Name(self.task, self.actor, self.method, self.observation, self.preset, self.replay)

    @property
    def key(self) -> tuple:
        """Key that identifies the evaluation."""
        return *self.name, self.seed, self.env_steps, self.split


@dataclasses.dataclass(frozen=True)
class Reference:
    """Score that others published.

    Attributes:
        task, method, observation: This package's names if it has any.
        env_steps: Env steps of training; None if unknown.
        value: Normalized performance.
        bound: "is", or "below" for an upper bound.
        certainty: "number" stated by the source, value read from its "plot", or derived from its
            "text".
        source: Reference of the publication.
    """

    task: str
    method: str
    observation: str
    env_steps: int | None
    value: float
    bound: str
    certainty: str
    source: str

    def compares(self, name: Name) -> bool:
        """Returns whether it is a score of a result's task, method and observation without arms."""
        own = self.task, self.method, self.observation
        return own == (name.task, name.method, name.observation) and name.actor not in ARMS


def _parser(
    make: Callable[[str], Any], valid: str, good: Callable[[Any], Any] = lambda value: True
) -> _Parser:
    def parsed(text: str) -> Any:
        if not good(value := make(text)):
            raise ValueError
        return value

    return parsed, valid


def _one_of(names: Collection[str]) -> _Parser:
    return _parser(str, ", ".join(names), names.__contains__)


_WORD = _parser(
    str, "small letters, digits, _ + . -", re.compile("[a-z0-9][a-z0-9_+.-]*").fullmatch
)
# Methods can also be MODULE:FUNCTION.
_METHOD = _parser(
    str, "letters, digits, _ + . : -", re.compile("[A-Za-z0-9][A-Za-z0-9_+.:-]*").fullmatch
)
_COUNT = _parser(int, "a whole number, 0 or more", lambda value: value >= 0)
_SCORE = _parser(float, "a finite number", math.isfinite)
_PARSERS: dict[str, _Parser] = {
    "task": _one_of(TASKS),  # Custom tasks are added later.
    "method": _METHOD,
    **dict.fromkeys(("actor", "observation", "preset", "replay"), _WORD),
    **dict.fromkeys(("seed", "env_steps", "updates", "episodes"), _COUNT),
    "seconds": _parser(float, "0 or more, or nothing", lambda value: 0 <= value < math.inf),
    "split": _one_of(("train", "evaluate")),
    **dict.fromkeys(("normalized_performance", "value"), _SCORE),
    "success": _parser(float, "a number in 0..1", lambda value: 0 <= value <= 1),
    "final": _parser({"0": False, "1": True}.__getitem__, "0 or 1"),
    "bound": _one_of(("is", "below")),
    "certainty": _one_of(("number", "plot", "text")),
    "source": _parser(str, "words", bool),
}


def _read(file: pathlib.Path, kind: type[_T]) -> list[_T]:
    """Reads a CSV file as objects of a dataclass, whose fields are the columns."""
    fields: Sequence[dataclasses.Field] = dataclasses.fields(kind)  # type: ignore[arg-type]
    columns, result = [field.name for field in fields], []
    with naming(file, "read"):
        lines = csv.reader(io.StringIO(read_whole(file).decode(), newline=""))
        table = _cells(lines)
    if (header := table[0][1] if table else []) != columns:
        raise StoreError(f"{file}, line 1: columns={header} is not valid: expected {columns}")
    for number, cells in table[1:]:
        values, where = [], f"{file}, line {number}"
        if len(cells) != len(columns):
            last = columns[min(len(cells), len(columns)) - 1]
            raise StoreError(f"{where}: it ends at column {last!r}; valid: all of {columns}, once")
        for field, cell in zip(fields, cells, strict=True):
            parser, valid = _PARSERS[field.name]
            try:
                optional = not cell and type(None) in getattr(field.type, "__args__", ())
                values.append(None if optional else parser(cell))
            except (LookupError, ValueError):
                message = f"{where}: {field.name}={cell!r} is not valid: expected {valid}"
                raise StoreError(message) from None
        result.append(kind(*values))
    return result


def _cells(lines: Any) -> list[tuple[int, list[str]]]:
    """Returns the number and the cells of each line."""
    try:
        return [(lines.line_num, cells) for cells in lines]
    except csv.Error as error:  # A field has more than 131,072 characters.
        raise ValueError(f"line {lines.line_num}: {error}") from error


def read_rows(file: pathlib.Path) -> list[Row]:
    """Reads rows of a CSV file.

    Raises:
        StoreError: for an invalid file, column or value (with its line), or two different rows of
            the same evaluation.
    """
    return merged(_read(file, Row))


def read_references(file: pathlib.Path) -> list[Reference]:
    """Reads published scores of others; errors are those of `read_rows`."""
    return _read(file, Reference)


def read_folder(path: pathlib.Path) -> list[Row]:
    """Reads the rows of a training or a planner's evaluation from a folder, CSV or JSON file.

    Raises:
        StoreError: for other folders or files, or invalid rows.
    """
    file = path / FILE if (path / FILE).exists() else path
    return read_rows(file) if file.suffix == ".csv" else rows_of_planner(read_results([file])[0])


def rows_of_planner(result: Mapping[str, Any]) -> list[Row]:
    """Returns the rows of a planner's evaluation, one for each seed.

    The preset is "paper" with the paper's budget, iterations and horizon, a plan in every step and
    the task's default settings except the actor, otherwise "small".

    Raises:
        StoreError: for another policy, or variations of both splits.
    """
    task, policy = result["task"], result["policy"]
    splits = [s for s, own in SPLITS.items() if set(result["variations"]) <= set(own)]
    if policy not in PLANNERS or splits[0] == "all":
        raise StoreError(f"{policy!r} on {task}: expected a planner, on variations of one split")
    usual = dataclasses.asdict(Planning(TASKS[task].resolve().planning_horizon))
    settings = {**result["settings"]}
    actor = settings.pop("actor", DEFAULT_ACTOR)
    is_paper = result["planning"] == usual and not settings
    name = Name(task, actor, policy, "simulator", "paper" if is_paper else "small", "none")
    rows = []
    for seed in result["seeds"]:
        own = [episode for episode in result["episodes"] if episode["seed"] == seed]
        score, success = (
            float(np.mean([e[key] for e in own])) for key in ("normalized_performance", "success")
        )
        steps, episodes = planned_env_steps(result), len(own)
        rows.append(Row(*name, seed, steps, 0, None, splits[0], episodes, score, success, True))
    return rows


def planned_env_steps(result: Mapping[str, Any]) -> int:
    """Returns the env steps that a planner simulates in an episode, from its evaluation result."""
    planning, steps = result["planning"], horizon_of(result["task"], result["settings"])
    return -(-steps // planning["replan_every"]) * planning["budget"]


def merged(*several: Iterable[Row]) -> list[Row]:
    """Returns all rows, sorted by key, without duplicates.

    Raises:
        StoreError: for two different rows of the same evaluation: published rows are not replaced.
    """
    result: dict[tuple, Row] = {}
    for row in (row for rows in several for row in rows):
        old = result.setdefault(row.key, row)
        if old != row:
            raise StoreError(f"two results of one evaluation; remove one: {old} and {row}")
    return [result[key] for key in sorted(result)]


def write_rows(rows: Iterable[Row], file: pathlib.Path) -> None:
    """Writes rows to a CSV file for `read_rows`."""
    write_csv(file, COLUMNS, [{**vars(row), "final": int(row.final)} for row in rows])
