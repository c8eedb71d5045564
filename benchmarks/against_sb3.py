"""SAC of Stable-Baselines3 beside ours: the same task, settings, env steps and evaluations.

    python -m benchmarks.against_sb3 sb3 --out sb3.csv
    python -m benchmarks.against_sb3 ours --out ours.csv

straighten_rope as it is, its reward times 50; three seeds; an update for every four env steps.
Networks are drawn as each library does, and SB3's deviations are clipped where ours are squashed.
"""

import argparse
import csv
import pathlib
import time
from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.env_util import make_vec_env

import softgym_mj
from softgym_mj.learning.curves import FILE, write_curve
from softgym_mj.learning.registry import find_method
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.training import Training
from softgym_mj.variations.indices import SPLITS

TASK, SEEDS = "straighten_rope", (0, 1, 2)
WORLDS, PART, PARTS = 16, 25_600, 8
EPISODES, FINAL = 20, 200
REWARD_SCALE, RANDOM, UPDATES, BATCH = 50.0, 1_008, 4, 256
HIDDEN, RATE, DISCOUNT, TAU, ALPHA = (256, 256), 3e-4, 0.99, 0.005, 0.1


def scores(
    predict: Callable[..., tuple[np.ndarray, Any]], variations: Sequence[int]
) -> tuple[float, float]:
    """Mean normalised performance and success at the end of an episode of each variation."""
    envs = softgym_mj.make_vec(
        TASK, len(variations), device="host", observation="reduced", split="all",
        autoreset_mode="Disabled",
    )  # fmt: skip
    seen, _ = envs.reset(options={"variation": [*variations]})
    ended = np.zeros(len(variations), bool)
    while not ended.any():
        seen, _, _, ended, infos = envs.step(
            predict(np.asarray(seen, np.float32), deterministic=True)[0]
        )
    envs.close()
    return float(infos["normalized_performance"].mean()), float(infos["success"].mean())


def sb3(out: pathlib.Path) -> None:
    """Trains seed after seed; goes on after the last part that has ended, if there is one."""
    rows: list[dict[str, Any]] = []
    if (out / FILE).exists():
        with (out / FILE).open() as file:
            rows = [*csv.DictReader(file)]
    for seed in SEEDS:
        envs = make_vec_env(
            softgym_mj.TASKS[TASK].gymnasium_id, WORLDS, seed,
            env_kwargs={"observation": "reduced"},
            wrapper_class=gymnasium.wrappers.TransformReward,
            wrapper_kwargs={"func": lambda reward: REWARD_SCALE * reward},
        )  # fmt: skip
        size = envs.action_space.shape
        assert size is not None
        model = SAC(
            "MlpPolicy", envs, RATE, PARTS * PART, RANDOM, BATCH, TAU, DISCOUNT, train_freq=1,
            gradient_steps=UPDATES, ent_coef=f"auto_{ALPHA}", target_entropy=-float(size[0]),
            policy_kwargs={"net_arch": [*HIDDEN]}, seed=seed, device="cpu",
        )  # fmt: skip
        done = [row for row in rows if int(row["seed"]) == seed]
        seconds = float(done[-1]["seconds"]) if done else 0.0
        kept = out / f"seed_{seed}"
        if done:
            model = SAC.load(kept, envs, device="cpu")
            model.load_replay_buffer(kept.with_suffix(".pkl"))
        for part in range(1 + len(done) // 2, PARTS + 1):
            start = time.perf_counter()
            model.learn(PART, reset_num_timesteps=part == 1)
            seconds += time.perf_counter() - start
            for split in ("train", "evaluate"):
                indices, is_last = SPLITS[split], part == PARTS and split == "evaluate"
                number = FINAL if is_last else EPISODES
                chosen = indices[:: len(indices) // number][:number]
                found, success = scores(model.predict, chosen)
                rows.append(
                    {
                        "task": TASK, "method": "sac_sb3", "observation": "reduced",
                        "preset": "custom", "replay": "plain", "seed": seed,
                        "env_steps": part * PART, "updates": model._n_updates,
                        "seconds": round(seconds, 1), "split": split, "episodes": number,
                        "normalized_performance": found, "success": success,
                        "final": int(part == PARTS),
                    }
                )  # fmt: skip
                print(rows[-1], flush=True)
            model.save(kept)
            model.save_replay_buffer(kept.with_suffix(".pkl"))
            write_curve(out, rows)
        envs.close()


def ours(out: pathlib.Path) -> None:
    """Trains all seeds side by side."""
    settings = TrainingSettings(
        TASK, env_steps=PARTS * PART, worlds=WORLDS, part=PART, reward_scale=REWARD_SCALE,
        episodes=EPISODES, final_episodes=FINAL,
    )  # fmt: skip
    method = find_method(
        "sac", random_steps=RANDOM, updates=UPDATES, batch=BATCH, replay=PARTS * PART,
        hidden=HIDDEN, discount=DISCOUNT, tau=TAU, actor_rate=RATE, critic_rate=RATE,
        alpha_rate=RATE, alpha=ALPHA, alpha_beta=0.9, actor_every=1, target_every=1,
    )  # fmt: skip
    training = Training(settings, method, SEEDS, out, "host")
    training.run(lambda now, news: print(now.said(), flush=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("whose", choices=("sb3", "ours"))
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    {"sb3": sb3, "ours": ours}[arguments.whose](arguments.out)


if __name__ == "__main__":
    main()
