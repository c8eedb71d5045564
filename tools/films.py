"""The moving pictures of the README, docs/gifs: the scripted expert at each task.

`python -m tools.gifs` (`make gifs`) writes them; some minutes. Names of tasks: only theirs.
"""

import pathlib
import sys
from collections.abc import Sequence

import numpy as np
from PIL import Image

from softgym_mj.envs.load import load
from softgym_mj.policies.episodes import play
from softgym_mj.registry import TASKS

FOLDER = pathlib.Path(__file__).parent.parent / "docs" / "gifs"
SIZE = 160  # Side [pixels].
OVERSAMPLED = 3  # Times as large when drawn: smooth edges.
COLOURS = 48  # With more, files grow faster than pictures improve.
HOLD = 1200  # Of the end, before it starts anew [ms].
STILL = 0.3  # Mean difference of two pictures without motion [of 255].
REST = 6  # Pictures kept after the last motion.


def until_rest(frames: np.ndarray) -> np.ndarray:
    """The pictures (n, ...) without those at the end in which nothing moves any more."""
    differences = np.abs(frames.astype(np.int16) - frames[-1]).mean(axis=(1, 2, 3))
    (moving,) = np.nonzero(differences > STILL)
    return frames[: moving.max(initial=0) + 1 + REST]


def smaller(frames: np.ndarray) -> np.ndarray:
    """Pictures (n, size, size, 3) with sides divided by `OVERSAMPLED`: means of squares."""
    n, size = frames.shape[0], frames.shape[1] // OVERSAMPLED
    squares = frames.reshape(n, size, OVERSAMPLED, size, OVERSAMPLED, 3)
    return squares.mean(axis=(2, 4)).round().astype(np.uint8)


def write_gif(frames: Sequence[np.ndarray], milliseconds: int, file: pathlib.Path) -> None:
    """Writes pictures with one palette for all, so that what stands still costs nothing."""
    sample = np.hstack(frames[:: max(1, len(frames) // 8)])
    palette = Image.fromarray(sample).quantize(COLOURS, dither=Image.Dither.NONE)
    pictures = [
        Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE)
        for frame in frames
    ]
    durations = [milliseconds] * (len(pictures) - 1) + [HOLD]
    file.parent.mkdir(parents=True, exist_ok=True)
    pictures[0].save(
        file, save_all=True, append_images=pictures[1:], duration=durations, loop=0, optimize=True
    )


def main(names: Sequence[str]) -> None:
    for name in TASKS:
        if names and name not in names:
            continue
        env = load(name, split="all", look="paper")
        episode = play(env, "scripted", env.task.example_variation, size=SIZE * OVERSAMPLED)
        frames = until_rest(smaller(episode.frames))
        file = FOLDER / f"{name}.gif"
        write_gif(frames, round(1000 / episode.fps), file)
        score = episode.info["normalized_performance"][-1]
        print(f"{file.name}: {len(frames)} pictures, {file.stat().st_size / 1e3:.0f} kB, "
              f"normalised performance {score:.2f}")  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1:])
