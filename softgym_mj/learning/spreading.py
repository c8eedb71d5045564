"""Trains each seed in a process, or on a machine, of its own."""

import pathlib
from collections.abc import Callable, Sequence
from typing import Any

from softgym_mj.learning import reports
from softgym_mj.learning.checkpoints import alone
from softgym_mj.learning.curves import write_curve
from softgym_mj.learning.joining import join
from softgym_mj.learning.learner import Method
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.training import Training
from softgym_mj.parallel.executors import Executor
from softgym_mj.policies.rollouts import received, sent_to
from softgym_mj.registry import TASKS, TaskRecord

Row = dict[str, Any]  # Row of a curve.


def train_each(
    settings: TrainingSettings,
    method: Method,
    seeds: Sequence[int],
    folder: pathlib.Path,
    device: str,
    learner_device: str | None,
    executor: Executor,
    progress: Callable[[int, list[Row]], None] = lambda seed, rows: None,
) -> list[Row]:
    """Trains each seed in a call of its own, which prints a line per minute.

    A killed call continues from its last checkpoint.

    Args:
        settings, method, device, learner_device: Arguments of `Training`.
        seeds: Seeds of the trainings.
        folder: Folder with a folder for each seed and the curve of finished seeds; machines of a
            cluster must share it.
        executor: Executor of the calls.
        progress: Called with each finished seed and its curve.

    Returns:
        The curve of all seeds.
    """
    result: dict[int, list[Row]] = {}
    task = sent_to(executor, settings.task)
    calls = [
        (task, settings, method, seed, folder / f"seed_{seed}", device, learner_device)
        for seed in seeds
    ]
    rows: list[Row] = []
    with alone(folder):
        for i, own in executor.results(_trained, calls):
            result[seeds[i]] = own
            rows = [row for seed in sorted(result) for row in result[seed]]
            rows.sort(key=lambda row: (row["env_steps"], row["split"] != "train"))
            write_curve(folder, rows)
            progress(seeds[i], own)
        join([folder / f"seed_{seed}" for seed in sorted(result)], folder)
    return rows


def _trained(
    task: TaskRecord | bytes,
    settings: TrainingSettings,
    method: Method,
    seed: int,
    folder: pathlib.Path,
    device: str,
    learner_device: str | None,
) -> list[Row]:
    record = received(task)
    TASKS.setdefault(record.name, record)
    training = Training(settings, method, [seed], folder, device, learner_device)
    with reports.repeated(lambda: reports.progress(training), reports.LINE_SECONDS):
        training.run(on_start=reports.start)
    return training.rows
