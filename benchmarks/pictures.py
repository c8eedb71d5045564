"""What images of many environments at once have in common with OpenGL's of one.

    python -m benchmarks.pictures --out docs/pictures.json --sheet docs/batch_pictures.jpg

Ten evaluation variations of each task, where they start and after some random env steps. The
kernel that draws on a GPU runs on the processor here: its bits are the same.
"""

import argparse
import json
import pathlib
from typing import Any

import imageio.v3 as imageio
import numpy as np
from PIL import Image, ImageDraw, ImageFont

import softgym_mj
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.rendering.observables import LABELS

VARIATIONS, STEPS = list(range(800, 810)), 6  # Env steps between the two states of a variation.
STRIP = 20  # [pixels] Height of the label above a picture.
OBSERVED = ["rgb", "depth", "segmentation"]


def states(task: str) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """What is observed in each state, drawn together and alone."""
    settings: dict[str, Any] = {"observation": OBSERVED, "split": VARIATIONS}
    envs = softgym_mj.make_vec(task, len(VARIATIONS), device="host", **settings)
    env = SoftGymEnv(task, **settings)
    shape = STEPS, *envs.action_space.shape
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, shape).astype(np.float32)
    starts, _ = envs.reset(options={"variation": VARIATIONS})
    for each in actions:
        ends, *_ = envs.step(each)
    found = []
    for i, variation in enumerate(VARIATIONS):
        alone, _ = env.reset(options={"variation": variation})
        found.append(({name: starts[name][i] for name in OBSERVED}, alone))
        for each in actions:
            alone, *_ = env.step(each[i])
        found.append(({name: ends[name][i] for name in OBSERVED}, alone))
    envs.close()
    env.close()
    return found


def compared(pairs: list[tuple[dict[str, Any], dict[str, Any]]]) -> dict[str, Any]:
    """Overlaps of masks, and differences."""
    overlaps: dict[str, list[float]] = {}
    for together, alone in pairs:
        for number, label in enumerate(LABELS):
            one, other = (seen["segmentation"] == number for seen in (together, alone))
            if other.any():
                overlaps.setdefault(label, []).append(
                    float((one & other).sum() / (one | other).sum())
                )
    away = [np.abs(a["depth"] - b["depth"]) for a, b in pairs]
    colors = [np.abs(a["rgb"].astype(float) - b["rgb"]).mean() for a, b in pairs]
    return {
        "states": len(pairs),
        "overlap": {
            label: {"mean": round(float(np.mean(all_)), 4), "least": round(min(all_), 4)}
            for label, all_ in overlaps.items()
        },
        "depth_median_m": float(np.median(away)),
        "depth_share_beyond_5mm": round(float(np.mean([(a > 5e-3).mean() for a in away])), 4),
        "rgb_mean_difference": round(float(np.mean(colors)), 2),
    }


def labeled(picture: np.ndarray, label: str) -> np.ndarray:
    """A picture with its label on a strip above it."""
    strip = Image.new("RGB", (picture.shape[1], STRIP), "white")
    font = ImageFont.load_default(STRIP - 6)
    ImageDraw.Draw(strip).text((4, 1), label, "black", font)
    return np.vstack([np.asarray(strip), picture])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tasks", nargs="+", default=list(softgym_mj.TASKS))
    parser.add_argument("--out", type=pathlib.Path)
    parser.add_argument("--sheet", type=pathlib.Path, help="a picture of each task, both ways")
    arguments = parser.parse_args()
    found, rows = {}, []
    for task in arguments.tasks:
        pairs = states(task)
        found[task] = compared(pairs)
        print(task, found[task], flush=True)
        rows.append(
            [
                labeled(np.hstack([pairs[i][k]["rgb"] for i in (1, 5)]), f"{task}, {name}")
                for k, name in ((1, "OpenGL"), (0, "batch"))
            ]
        )
    if arguments.out:
        arguments.out.write_text(json.dumps(found, indent=1) + "\n")
    if arguments.sheet:
        half = -(-len(rows) // 2)
        columns = [
            np.vstack([np.hstack(row) for row in part]) for part in (rows[:half], rows[half:])
        ]
        imageio.imwrite(arguments.sheet, np.hstack(columns), quality=92)


if __name__ == "__main__":
    main()
