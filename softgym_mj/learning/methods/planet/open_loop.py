"""Open-loop predictions of a world model, from some frames and the following actions."""

import dataclasses
import io
import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

import softgym_mj
from softgym_mj.evaluation.plots import new_figure
from softgym_mj.exceptions import InvalidArgumentError, check_count
from softgym_mj.learning.learner import split_by_seed
from softgym_mj.learning.methods.planet.latent import centered
from softgym_mj.learning.methods.planet.learner import PlaNet
from softgym_mj.learning.training import Training
from softgym_mj.storage.files import write_whole

CONTEXT, PREDICTED = 5, 30  # Frames (SoftGym, figure of predictions).
# Largest minus smallest of a pixel's colors, of 255, from which it shows cloth, rope or water, or
# the rings of pickers: tables, walls and glasses are gray.
_COLORFUL = 38
_COLUMNS = 5  # The last frame that was seen, and four that were not (SoftGym).
_DPI, _INCHES = 150, 1.5  # Dots per inch; height and width of a picture.


@dataclasses.dataclass(frozen=True)
class Prediction:
    """Observed and predicted frames, with arrays (seeds, n, steps, ...).

    The first is the last frame of the context, as the model has seen it; all others are predicted.

    Attributes:
        frames, predicted: images (..., h, w, 3) uint8.
        psnr: peak signal-to-noise ratios (...) [dB].
        overlap: of what is colorful in both (...): intersection over union, 1 of nothing.
    """

    frames: np.ndarray
    predicted: np.ndarray
    psnr: np.ndarray
    overlap: np.ndarray


@torch.no_grad()
def predict(learner: PlaNet, frames: Tensor, actions: Tensor, context: int = CONTEXT) -> Prediction:
    """Predicts frames from the first ones and from actions; latents are their means.

    Args:
        learner: whose model predicts.
        frames: before each action and after the last (seeds, n, actions + 1, h, w, 3), uint8.
        actions: (seeds, n, actions, action).
        context: frames that are seen.

    Raises:
        InvalidArgumentError: unless some frames are seen and at least one is not.
    """
    check_count("context", context, 1, actions.shape[2])
    if frames.shape[2] != actions.shape[2] + 1:
        raise InvalidArgumentError("frames", frames.shape, "one more than actions")
    model, bits = learner.model, learner.settings.bits
    belief, latent = model.nothing(frames.shape[1])
    before = torch.zeros_like(actions[:, :, 0])
    for t in range(context):
        belief = model.advance(belief, latent, before)
        seen = model.encoder(centered(frames[:, :, t], bits))
        latent, before = model.posterior(belief, seen).mean, actions[:, :, t]
    states = model.imagine(belief, latent, actions[:, :, context - 1 :].unbind(2))
    images = [model.image(*state) for state in [(belief, latent), *states]]
    shown = (255.0 * (torch.stack(images, 2) + 0.5)).round().clamp(0.0, 255.0).byte().cpu().numpy()
    real = frames[:, :, context - 1 :].cpu().numpy()
    return Prediction(real, shown, psnr(real, shown), overlap(real, shown))


def psnr(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Returns peak signal-to-noise ratios (...) [dB] of images (..., h, w, 3) uint8."""
    error = np.mean((frames.astype(float) - others) ** 2, axis=(-3, -2, -1))
    with np.errstate(divide="ignore"):
        return 10.0 * np.log10(255.0**2 / error)


def overlap(frames: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Returns intersection over union (...) of colored pixels in images (..., h, w, 3) uint8."""
    first, second = (np.ptp(each.astype(int), axis=-1) >= _COLORFUL for each in (frames, others))
    both, either = ((first & second).sum((-2, -1)), (first | second).sum((-2, -1)))
    return np.where(either > 0, both / np.maximum(either, 1), 1.0)


def record(
    learner: PlaNet, envs: Any, variations: Sequence[int], steps: int
) -> tuple[Tensor, Tensor]:
    """Plays the learner's best actions until the first episode ends.

    Args:
        learner: who plays.
        envs: seeds * variations environments that do not reset themselves.
        variations: of each seed.
        steps: most env steps.

    Returns:
        Frames and actions, as `predict` takes them.
    """
    problem, memory = learner.problem, None
    seen, _ = envs.reset(options={"variation": [*variations] * len(problem.seeds)})
    frames, actions = [split_by_seed(problem, seen)], list[Tensor]()
    first = torch.ones(frames[0].shape[:2], dtype=torch.bool, device=frames[0].device)
    for _ in range(steps):
        action, memory = learner.act(frames[-1], first, memory, explore=False)
        flat, first = action.flatten(0, 1), torch.zeros_like(first)
        inputs = flat if flat.is_cuda else flat.numpy()
        seen, _, terminated, truncated, _ = envs.step(inputs)
        frames.append(split_by_seed(problem, seen))
        actions.append(action)
        if (terminated | truncated).any():
            break
    return torch.stack(frames, 2), torch.stack(actions, 2)


def draw(prediction: Prediction, file: pathlib.Path, seed: int = 0, episode: int = 0) -> None:
    """Writes a PNG file with observed and predicted frames, and curves of all episodes.

    Args:
        prediction: what is drawn.
        file: where.
        seed, episode: places of the one that is shown.

    Raises:
        UnavailableError: without Matplotlib.
    """
    steps = prediction.psnr.shape[2]
    places = np.linspace(0, steps - 1, min(_COLUMNS, steps)).round().astype(int)
    figure = new_figure(_INCHES * len(places), 3.6 * _INCHES)
    grid = figure.add_gridspec(3, len(places), height_ratios=(1.0, 1.0, 1.2), hspace=0.15)
    for column, place in enumerate(places):
        for row, (name, images) in enumerate(
            (("seen", prediction.frames), ("predicted", prediction.predicted))
        ):
            axes = figure.add_subplot(grid[row, column])
            axes.imshow(images[seed, episode, place])
            axes.set(xticks=(), yticks=(), ylabel="" if column else name)
            if row == 0:
                axes.set_title("last seen" if place == 0 else f"+{place}", fontsize="small")
    left = figure.add_subplot(grid[2, :])
    for axes, values, color, name in (
        (left, prediction.psnr, "C0", "PSNR [dB]"),
        (left.twinx(), prediction.overlap, "C1", "overlap (IoU)"),
    ):
        low, median, high = np.percentile(values.reshape(-1, steps), (25, 50, 75), axis=0)
        axes.plot(median, color=color)
        axes.fill_between(range(steps), low, high, color=color, alpha=0.2, linewidth=0)
        axes.set_ylabel(name, color=color)
        axes.spines["top"].set_visible(False)
    left.set_xlabel("env steps after the last frame that was seen")
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=_DPI, bbox_inches="tight")
    write_whole(file, content.getvalue())


def predict_task(training: Training, variations: Sequence[int], file: pathlib.Path) -> Prediction:
    """Plays variations of a training's task, predicts 30 frames after 5 and draws them.

    Args:
        training: of PlaNet.
        variations: an episode of each, played by each seed; the first is shown.
        file: the figure's, a PNG.

    Raises:
        InvalidArgumentError: for another method.
        UnavailableError: without Matplotlib.
    """
    learner, own = training.learner, training.settings
    if not isinstance(learner, PlaNet):
        raise InvalidArgumentError("training", training.method.name, ["planet"])
    envs = softgym_mj.make_vec(
        own.task, len(variations) * len(training.seeds), device=training.device,
        observation="rgb", image_size=own.image_size, autoreset_mode="Disabled", split="all",
        **own.task_settings,
    )  # fmt: skip
    try:
        frames, actions = record(learner, envs, variations, CONTEXT + PREDICTED - 1)
    finally:
        envs.close()
    result = predict(learner, frames, actions)
    draw(result, file)
    return result
