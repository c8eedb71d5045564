"""Tasks measure many simulations at once as they measure each of them."""

import dataclasses
from typing import Any

import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj.tasks import Episode, State
from softgym_mj.tasks.shared.entries import labels
from softgym_mj.tasks.shared.observations import STATES

VARIATIONS, SAMPLES = (800, 807, 813, 999), 6  # 24 states of four sizes.
# [m] By which the points of an object or task are moved: far, unless it measures small moves.
NOISE = {"water": 0.4, "hang_cloth": 0.6, "route_cable": 0.1}
USUAL_NOISE = 0.03


def samples(task: str) -> tuple[Any, list[State], list[Episode]]:
    """A task, 24 states and their episodes."""
    settings = {} if "rope" in softgym_mj.TASKS[task].tags else {"fidelity": "fast"}
    env = softgym_mj.load(task, split="all", **settings)
    random, states, episodes = np.random.default_rng(0), [], []
    usual = NOISE.get(task, USUAL_NOISE)
    for variation in VARIATIONS:
        env.reset(variation)
        for _ in range(SAMPLES):
            state = env.task.state()
            points = {
                name: points + random.normal(0.0, NOISE.get(name, usual), points.shape)
                for name, points in state.points.items()
            }
            states.append(state._replace(points=points))
            episodes.append(env.task.episode)
    return env.task, states, episodes


def tensors(value: Any) -> Any:
    """Converts arrays to PyTorch's tensors."""
    if isinstance(value, dict):
        return {key: tensors(part) for key, part in value.items()}
    return torch.from_numpy(value)


def none_of(value: Any) -> Any:
    """A batch without members, of arrays with as many axes."""
    if isinstance(value, dict):
        return {key: none_of(part) for key, part in value.items()}
    if isinstance(value, State):
        return State(*map(none_of, value))
    if isinstance(value, Episode):
        return Episode(*(none_of(getattr(value, f.name)) for f in dataclasses.fields(value)))
    return value[:0]


def flattened(measured) -> dict[str, Any]:
    """All that is measured, by name."""
    measures, bounds, reduced = measured
    rewards = {f"reward_{name}": value for name, value in measures.rewards.items()}
    return {
        "performance": measures.performance,
        **rewards,
        **measures.info,
        "lower": bounds[0],
        "upper": bounds[1],
        **reduced,
    }


def measured(task, state: State, episode: Episode) -> dict[str, Any]:
    measures = task.measure(state, episode)
    further = labels(task.reduced(state, episode)) | task.secondary_metrics(
        state, episode, measures
    )
    names = ("reduced", "key_points", "markov", "proprioception")
    seen = {name: STATES[name].value(task, state, episode) for name in names}
    return flattened((measures, task.bounds(episode), further | seen))


@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_a_batch_is_measured_as_its_members(task):
    task, states, episodes = samples(task)
    singles = [measured(task, *pair) for pair in zip(states, episodes, strict=True)]
    assert len({single["performance"] for single in singles}) > 8  # Not all the same.
    state, episode = State.stack(states), Episode.stack(episodes)
    batches = {
        "numpy": (state, episode),
        "torch": (
            State(*map(tensors, state)),
            Episode(*(tensors(getattr(episode, f.name)) for f in dataclasses.fields(episode))),
        ),
    }
    for name, batch in batches.items():
        found = measured(task, *batch)
        assert set(found) == set(singles[0])
        for key, values in found.items():
            expected = np.array([single[key] for single in singles])
            kind = np.ndarray if name == "numpy" else torch.Tensor
            assert isinstance(values, kind | float)
            all_of_them = np.broadcast_to(np.asarray(values), expected.shape)
            np.testing.assert_allclose(all_of_them, expected, rtol=1e-6, atol=1e-9, err_msg=key)
        for key, values in measured(task, *map(none_of, batch)).items():
            shape = np.shape(found[key])
            assert np.shape(values) == ((0, *shape[1:]) if shape else ()), (name, key)
