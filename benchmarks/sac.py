"""Trains Stable-Baselines3's SAC on the reduced state of straighten_rope and draws its progress.

As it comes, SAC hardly learns anything here in 20,000 env steps: a picker that moves at random
holds the rope in 4 % of them. Three things help, and leave the environment, its actions and its
states as they are:

- The reward is the progress in a step: the increase of the normalised performance, plus how much
  nearer the pickers have come to the ends of the rope. There are no demonstrations.
- The networks get the state in units of its spread, and where the ends are from the pickers.
- The task is the same in a mirror, turned by 90 degrees, with the rope reversed and with the
  pickers exchanged: every step that is learned from is seen in one of these 32 ways, at random.

Every `--every` env steps the mean action is scored on evaluation variations 800..809: normalised
performance at the last step. Random actions are scored alike.

    OMP_NUM_THREADS=1 python benchmarks/sac.py --seeds 0 1 --out sac
"""

import argparse
import json
import pathlib
import time
from collections.abc import Callable, Sequence

import gymnasium
import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

import softgym_mj
from softgym_mj.evaluation.plots import new_figure

TASK = softgym_mj.TASKS["straighten_rope"].gymnasium_id
KEY_POINTS, PICKERS = 10, 2  # The reduced state: x, y, z [m] of each, in this order.
ENDS = [0, KEY_POINTS - 1]
VARIATIONS = range(800, 810)

SPREAD = 0.15  # [m] Of positions, about: networks learn best from numbers near 1.
NEAR = 0.1  # [m] Twice the pick distance: what matters where a picker is close to an end.
REWARD_SCALE = 20.0  # Makes a step of pulling, which gains 0.07, worth about 1.
APPROACH = 1.0  # [1/m] Of the reward for coming nearer: less than pulling gains on the same way.
DISCOUNT = 0.9  # Looks 10 steps ahead: enough to reach an end and to pull it out.
LEARNING_RATE, BATCH, NETWORK = 1e-3, 256, [128, 128]  # Smaller than usual: 4 ms an update.
UPDATES = 2  # Of an env step.
TARGET_RATE = 0.01  # Of the target networks: twice the usual, as there are few updates.
# Weight of the entropy at first; it is tuned. From 1, the usual start, it takes 5000 updates to
# fall to where it belongs, and until then the critics learn entropies.
ENTROPY = "auto_0.05"
START = 1000  # Env steps with random actions before the first update.


def split(state):
    """Key points (..., 10, 3) and pickers (..., 2, 3) of reduced states (..., 36)."""
    points = state.reshape(*state.shape[:-1], KEY_POINTS + PICKERS, 3)
    return points[..., :KEY_POINTS, :], points[..., KEY_POINTS:, :]


class Progress(gymnasium.Wrapper):
    """Rewards the increase of the normalised performance and the approach of the pickers."""

    def reset(self, **arguments):
        observation, info = self.env.reset(**arguments)
        self._value = self._worth(observation, info)
        return observation, info

    def step(self, action):
        observation, _, terminated, truncated, info = self.env.step(action)
        before, self._value = self._value, self._worth(observation, info)
        return observation, self._value - before, terminated, truncated, info

    @staticmethod
    def _worth(observation, info) -> float:
        rope, pickers = split(observation)
        distances = np.linalg.norm(rope[ENDS][:, None] - pickers, axis=-1)  # End, picker.
        distance = min(np.trace(distances), np.trace(distances[::-1])) / PICKERS
        return REWARD_SCALE * (info["normalized_performance"] - APPROACH * float(distance))


class Features(BaseFeaturesExtractor):
    """The state and the vectors between what matters, in units of their spread."""

    def __init__(self, observation_space):
        super().__init__(observation_space, 3 * (KEY_POINTS + PICKERS + 2 * PICKERS + 1))

    def forward(self, observations):
        rope, pickers = split(observations)
        ends = rope[:, ENDS]
        from_pickers = (ends[:, None] - pickers[:, :, None]).flatten(1)
        along = ends[:, 0] - ends[:, 1]
        return torch.cat([observations / SPREAD, from_pickers / NEAR, along / SPREAD], dim=1)


class SymmetricBuffer(ReplayBuffer):
    """Every sampled step is mirrored, turned and renumbered at random."""

    def _get_samples(self, batch_inds, env=None):
        samples = super()._get_samples(batch_inds, env)
        number = len(batch_inds)
        signs = torch.randint(0, 2, (number, 1, 2)) * 2.0 - 1.0
        diagonal, reverse, exchange = torch.rand(3, number, 1, 1) < 0.5

        def turned(vectors):  # (number, n, 3 or more): x, y, the rest.
            plane = vectors[..., :2] * signs
            plane = torch.where(diagonal, plane.flip(-1), plane)
            return torch.cat([plane, vectors[..., 2:]], dim=-1)

        def seen(states):
            rope, pickers = (turned(points) for points in split(states))
            rope = torch.where(reverse, rope.flip(1), rope)
            pickers = torch.where(exchange, pickers.flip(1), pickers)
            return torch.cat([rope, pickers], dim=1).flatten(1)

        actions = turned(samples.actions.view(number, PICKERS, 4))
        return samples._replace(
            observations=seen(samples.observations),
            next_observations=seen(samples.next_observations),
            actions=torch.where(exchange, actions.flip(1), actions).flatten(1),
        )


def make_model(env: gymnasium.Env, seed: int) -> SAC:
    return SAC(
        "MlpPolicy",
        Progress(env),
        learning_rate=LEARNING_RATE,
        learning_starts=START,
        batch_size=BATCH,
        tau=TARGET_RATE,
        gamma=DISCOUNT,
        gradient_steps=UPDATES,
        replay_buffer_class=SymmetricBuffer,
        ent_coef=ENTROPY,
        policy_kwargs={
            "net_arch": NETWORK,
            "features_extractor_class": Features,
            "optimizer_kwargs": {"fused": True},  # Faster on CPUs, too.
        },
        seed=seed,
        device="cpu",
    )


def score(env: gymnasium.Env, act: Callable[[np.ndarray], np.ndarray]) -> list[float]:
    """Normalised performances at the last steps of the evaluation variations."""
    scores = []
    for variation in VARIATIONS:
        observation, info = env.reset(options={"variation": variation})
        truncated = False
        while not truncated:
            observation, _, _, truncated, info = env.step(act(observation))
        scores.append(info["normalized_performance"])
    return scores


def train(seed: int, steps: int, every: int) -> dict:
    """Scores [one a variation] after how many env steps, and those of random actions."""
    env, test = (gymnasium.make(TASK, split=split) for split in ("train", "evaluate"))
    random = np.random.default_rng(seed)
    size = test.action_space.shape
    result = {"seed": seed, "random": score(test, lambda _: random.uniform(-1.0, 1.0, size))}
    model = make_model(env, seed)

    def act(observation):
        return model.predict(observation, deterministic=True)[0]

    curve, begin = {0: score(test, act)}, time.perf_counter()
    while model.num_timesteps < steps:
        model.learn(every, reset_num_timesteps=False)
        curve[model.num_timesteps] = score(test, act)
        minutes = (time.perf_counter() - begin) / 60
        mean = np.mean(curve[model.num_timesteps])
        print(f"seed {seed}, {model.num_timesteps} env steps, {minutes:.1f} min: {mean:.2f}")
    return {**result, "curve": curve}


def draw(results: Sequence[dict], file: pathlib.Path) -> None:
    """Mean scores over env steps, a line for each seed."""
    figure = new_figure(4.5, 3.0)
    axes = figure.subplots()
    for result in results:
        means = [np.mean(scores) for scores in result["curve"].values()]
        axes.plot(list(result["curve"]), means, marker=".", label=f"SAC, seed {result['seed']}")
    chance = np.mean([result["random"] for result in results])
    axes.axhline(chance, color="0.5", linestyle=":", label="random actions")
    axes.set(xlabel="env steps", ylabel="normalised performance", ylim=(0.0, 1.0))
    axes.legend(frameon=False, loc="lower right")
    figure.savefig(file, dpi=150, bbox_inches="tight")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=20_000)
    parser.add_argument("--every", type=int, default=2_500)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("sac"))
    arguments = parser.parse_args()
    torch.set_num_threads(1)  # Networks as small as these gain nothing from more.
    arguments.out.mkdir(parents=True, exist_ok=True)
    results = []
    for seed in arguments.seeds:
        results.append(train(seed, arguments.steps, arguments.every))
        (arguments.out / "sac.json").write_text(json.dumps(results, indent=2))
        draw(results, arguments.out / "sac.png")


if __name__ == "__main__":
    main()
