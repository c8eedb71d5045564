"""Videos of README and docs, docs/videos: the scripted expert at each task.

`python -m tools.videos` (`make videos`) writes them, in 15 minutes without a GPU. Arguments select
some: names of tasks, of policies in docs/results/policies such as straighten_rope-sac, or of `ARMS`
(the expert with an arm that uses its wrist). `tasks.webp` shows SoftGym's tasks and arms for
eight seconds, made of the others.
"""

import pathlib
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from softgym_mj.envs.load import load
from softgym_mj.policies.episodes import play
from softgym_mj.policies.exported import has_images, observes
from softgym_mj.registry import DOMAIN, TASKS, task_names

DOCS = pathlib.Path(__file__).parent.parent / "docs"
FOLDER, LEARNED = DOCS / "videos", DOCS / "results" / "policies"
SIZE = 240  # Side [pixels].
PASSES = 16  # Number of images averaged: soft shadows, smooth edges.
QUALITY = 80  # WebP quality, 0..100: below, soft shadows are blocky.
COLUMNS, FRAMES, FRAME = 6, 100, 80  # Columns, images and their duration [ms] of `tasks`.
LABEL = 15  # Height of the names in it [pixels].
ANGLE = 35.0  # Vertical field of view of the camera "overview" [deg].
HOLD = 1200  # Duration of the last image [ms].
STILL = 0.3  # Mean difference of two images without motion [of 255].
REST = 6  # Images kept after the last motion.
LONG = 75  # Number of images from which on a video of a learned policy has every second one.
# Arguments of videos of arms that turn what they hold.
ARMS: dict[str, dict[str, str]] = {
    "fold_cloth-tilted": {"actor": "franka", "action": "pose"},
    "pour_water-wrist": {"actor": "ur5e"},
}
# Variations of videos, else the task's example: where the policy ends badly there, leaves the image
# or is done in few steps.
VARIATIONS = {
    "straighten_rope-sac": 979, "fold_cloth-sac": 805, "fold_cloth-tqc": 805,
    "straighten_rope-distill": 979, "fold_cloth-distill": 805,
    "straighten_rope-distill_rgb": 999, "straighten_rope-teacher_student": 995,
    "route_cable-sac": 914, "straighten_rope-franka-sac": 803,
    "straighten_rope-franka-distill": 917, "fold_cloth-franka-sac": 861,
    "pour_water-distill": 890, "pour_water_amount-distill": 938,
}  # fmt: skip


def names_of_all() -> list[str]:
    """Names of all videos: tasks, arms that use their wrists, and learned policies."""
    return [*TASKS, *ARMS, *sorted(file.stem for file in LEARNED.glob("*.pt2"))]


def until_rest(frames: np.ndarray) -> np.ndarray:
    """Returns the images (n, ...) up to `REST` after the last motion."""
    differences = np.abs(frames.astype(np.int16) - frames[-1]).mean(axis=(1, 2, 3))
    (moving,) = np.nonzero(differences > STILL)
    return frames[: moving.max(initial=0) + 1 + REST]


def write_video(frames: Sequence[np.ndarray], milliseconds: int, file: pathlib.Path) -> None:
    """Writes images as an animated WebP that holds the last one."""
    pictures = [Image.fromarray(frame) for frame in frames]
    durations = [milliseconds] * (len(pictures) - 1) + [HOLD]
    file.parent.mkdir(parents=True, exist_ok=True)
    pictures[0].save(
        file, save_all=True, append_images=pictures[1:], duration=durations, loop=0,
        quality=QUALITY, method=6,
    )  # fmt: skip


def labeled(video: pathlib.Path) -> tuple[list[np.ndarray], np.ndarray]:
    """Returns images of a video with task and arm in a corner, and when each ends [ms]."""
    task, actor = video.stem.split("-")[0].replace("_", " "), ARMS.get(video.stem, {}).get("actor")
    font, name = ImageFont.load_default(LABEL), f"{task}, {actor}" if actor else task
    pictures, ends = [], [0]
    with Image.open(video) as images:
        for i in range(images.n_frames):
            images.seek(i)
            picture = images.convert("RGB")
            draw, at = ImageDraw.Draw(picture), (6, SIZE - LABEL - 8)
            draw.text(at, name, font=font, fill="white", stroke_width=1, stroke_fill="black")
            pictures.append(np.asarray(picture))
            ends.append(ends[-1] + int(images.info["duration"]))
    return pictures, np.array(ends[1:])


def all_tasks(folder: pathlib.Path) -> list[np.ndarray]:
    """Returns images of SoftGym's tasks and arms side by side, at one speed; finished ones hold."""
    videos = [labeled(folder / f"{name}.webp") for name in (*task_names(DOMAIN), *ARMS)]
    longest = max(ends[-1] - HOLD for _, ends in videos)
    frames = []
    for now in np.linspace(0.0, longest, FRAMES):
        shown = [
            pictures[min(np.searchsorted(ends, now, side="right"), len(pictures) - 1)]
            for pictures, ends in videos
        ]
        rows = (shown[k : k + COLUMNS] for k in range(0, len(shown), COLUMNS))
        frames.append(np.vstack([np.hstack(row) for row in rows]))
    return frames


def is_learned(name: str) -> bool:
    """Whether a video shows a learned policy."""
    return name not in TASKS and name not in ARMS


def seen_by(name: str) -> dict[str, Any]:
    """Arguments of a video's task: the policy's observation, and the look it was trained with."""
    if not is_learned(name):
        return {"observation": "reduced", "look": "paper"}
    observed = observes(str(LEARNED / f"{name}.pt2"))
    return {**observed, "look": "fast" if has_images(observed["observation"]) else "paper"}


def main(names: Sequence[str]) -> None:
    for name in names or names_of_all():
        learned, settings = is_learned(name), ARMS.get(name, {})
        policy = str(LEARNED / f"{name}.pt2") if learned else "scripted"
        env = load(name.split("-")[0], split="all", **seen_by(name), **settings)
        variation = VARIATIONS.get(name, env.task.example_variation)
        # Learned policies fling the rope beyond the task's camera.
        camera = "overview" if learned and name.startswith("straighten_rope") else "task"
        if camera == "overview":
            env.physics.model.ptr.camera(camera).fovy = ANGLE
        episode = play(
            env, policy, variation, trust=learned, camera=camera, size=SIZE, passes=PASSES
        )
        frames = until_rest(episode.frames)
        every = 2 if learned and len(frames) > LONG else 1
        frames = frames[::-every][::-1]
        file = FOLDER / f"{name}.webp"
        write_video(frames, round(1000 * every / episode.fps), file)
        score = episode.info["normalized_performance"][-1]
        print(f"{file.name}: {len(frames)} pictures, {file.stat().st_size / 1e3:.0f} kB, "
              f"normalized performance {score:.2f}")  # fmt: skip
    if not names or set(names) & {*task_names(DOMAIN), *ARMS}:
        write_video(all_tasks(FOLDER), FRAME, FOLDER / "tasks.webp")


if __name__ == "__main__":
    main(sys.argv[1:])
