"""Golden episodes: what every task and actor does, to the last bit.

    python -m tests.golden.episodes

writes episodes.json anew: only after a change that is meant to change physics, start states,
rewards or observations. Everything is read through the public interface, so that it holds
whatever happens within.
"""

import functools
import hashlib
import json
import multiprocessing
import pathlib

import numpy as np

import softgym_mj

PATH = pathlib.Path(__file__).parent / "episodes.json"
FIDELITIES = ("fast", "default")
ACTORS = ("default", "franka", "sawyer")
VARIATIONS = (0, 800, 851, 999)
EXTRAS = {  # Settings that none of the above has, each with one variation.
    "straighten_rope": [
        {"actor": "pick_and_place"},
        {"actor": "pixel_pick_and_place"},
        {"num_pickers": 3},
        {"domain": "in_distribution"},
    ],
    "spread_cloth": [
        {"actor": "pick_and_place"},
        {"actor": "pixel_pick_and_place"},
        {"actor": "franka", "arms": 1},
        {"domain": "out_of_distribution"},
    ],
    "fold_cloth": [
        {"actor": "franka", "grasp": "friction"},
        {"actor": "sawyer", "grasp": "friction"},
        {"action_repeat": 3},
    ],
    "pour_water": [{"domain": "in_distribution"}, {"action_repeat": 4}],
}
# At the start the first is the same as max_edge_strain; the second is true of no golden episode.
UNUSED = ("episode_max_edge_strain", "diverged")
STEPS, KEPT = 10, 5  # Env steps, and after how many a snapshot is taken.


def cases() -> list[tuple[str, dict, tuple[int, ...]]]:
    """Task, settings, variations."""
    found = []
    for task in softgym_mj.TASKS:
        for actor in ACTORS:
            for fidelity in FIDELITIES:
                own = {} if actor == "default" else {"actor": actor}
                found.append((task, {"fidelity": fidelity, **own}, VARIATIONS))
        for extra in EXTRAS.get(task, []):
            found.append((task, {"fidelity": "fast", **extra}, VARIATIONS[1:2]))
    return found


def name(task: str, settings: dict, variation: int) -> str:
    """One text for a case."""
    words = [f"{key}={value}" for key, value in settings.items()]
    return " ".join([task, *words, f"variation={variation}"])


@functools.lru_cache(maxsize=1)
def _environment(task: str, settings: str):
    settings = json.loads(settings)
    return softgym_mj.load(task, split="all", observation=("full", "reduced"), **settings)


def _digest(*arrays) -> str:
    whole = hashlib.sha256()
    for array in arrays:
        whole.update(np.ascontiguousarray(array).tobytes())
    return whole.hexdigest()[:16]


def _number(value) -> str | list[str]:
    values = np.asarray(value, dtype=float)
    return values.item().hex() if values.ndim == 0 else [v.hex() for v in values.ravel().tolist()]


def play(task: str, settings: dict, variation: int) -> dict:
    """What seeded random actions do: numbers as hexadecimal floats, arrays as digests."""
    env = _environment(task, json.dumps(settings))
    timestep = env.reset(variation)
    spec = env.action_spec()
    random = np.random.default_rng(variation)
    actions = random.uniform(spec.minimum, spec.maximum, (STEPS, *spec.shape))
    found = {
        "start": _digest(timestep.observation["full"]),
        "info": {k: _number(v) for k, v in sorted(env.info().items()) if k not in UNUSED},
        "rewards": [],
        "states": [],
    }

    def step(action) -> tuple[str, str]:
        timestep = env.step(action)
        data = env.physics.data
        full, reduced = (timestep.observation[key] for key in ("full", "reduced"))
        return timestep.reward.hex(), _digest(full, reduced, data.qpos, data.qvel)

    snapshot = None
    for count, action in enumerate(actions):
        if count == KEPT:
            snapshot = env.get_state()
        reward, state = step(action)
        found["rewards"].append(reward)
        found["states"].append(state)
    env.set_state(snapshot)
    replayed = [step(action)[1] for action in actions[KEPT:]]
    assert replayed == found["states"][KEPT:], "a snapshot goes on otherwise"
    return found


def _play_all(case) -> dict[str, dict]:
    task, settings, variations = case
    return {name(task, settings, v): play(task, settings, v) for v in variations}


def main() -> None:
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        found = {}
        for part in pool.imap(_play_all, cases()):
            found |= part
            print(len(found), flush=True)
    PATH.write_text(json.dumps(found, indent=0) + "\n")


if __name__ == "__main__":
    main()
