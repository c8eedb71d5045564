"""Logs of trainings for TensorBoard or Weights & Biases; curves are written without them."""

import math
import pathlib
import uuid
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from softgym_mj.exceptions import check_name, import_extra
from softgym_mj.learning.training import Training
from softgym_mj.storage.files import read_whole, write_whole

POINTS = 100  # Log entries of a whole training.
LOGS = ("none", "tensorboard", "wandb")
WANDB_ID = "wandb_id"  # File with the id of the folder's run, which a continued training resumes.
Log = Callable[[Training, Mapping[str, Sequence[float]]], None]


def make_log(name: str, folder: pathlib.Path) -> Log:
    """Returns a callback for `Training.run` that logs losses (seeds,) and the curve.

    Args:
        name: One of `LOGS`; "wandb" uploads to the server that it is configured for.
        folder: Folder of the training.

    Raises:
        InvalidArgumentError: for another name.
        UnavailableError: without the package.
    """
    check_name("log", name, LOGS)
    if name == "none":
        return lambda training, losses: None
    if name == "tensorboard":
        import_extra("tensorboard", "TensorBoard", "learning")
        from torch.utils.tensorboard import SummaryWriter

        writer = SummaryWriter(str(folder / "tensorboard"))

        def write(training: Training, losses: Mapping[str, Sequence[float]]) -> None:
            _tell(training, losses, writer.add_scalar)
            writer.flush()  # A training can be killed at any time.

        return write
    wandb = import_extra("wandb", "Weights & Biases", "wandb")
    file = folder / WANDB_ID
    if not file.exists():
        write_whole(file, uuid.uuid4().hex.encode())
    own = {"id": read_whole(file).decode(), "name": folder.resolve().name}
    run = wandb.init(project="softgym_mj", dir=str(folder), resume="allow", **own)

    def add(key: str, value: float, env_steps: int) -> None:
        run.log({key: value, "env_steps": env_steps})

    return lambda training, losses: _tell(training, losses, add)


def _tell(
    training: Training, losses: Mapping[str, Sequence[float]], add: Callable[[str, float, int], Any]
) -> None:
    env_steps = training.env_steps
    for name, values in losses.items():
        for seed, value in zip(training.seeds, values, strict=True):
            if math.isfinite(value):
                add(f"{name}/{seed}", value, env_steps)
    for row in training.rows:
        if row["env_steps"] == env_steps:
            for name in ("normalized_performance", "success"):
                add(f"{row['split']}/{name}/{row['seed']}", row[name], env_steps)
