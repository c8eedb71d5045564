"""Minutes-long checks: random episodes without a warning, restore time, scripted experts."""

import time

import numpy as np
import pytest

import softgym_mj
from softgym_mj.policies.experts import make_policy

pytestmark = pytest.mark.slow

# [m] How far anything gets below the floor. A tipped cup may dip its outer wall some cm into the
# ground (docs/softgym.md 3.2) and takes along the water that lies there, until it is lifted.
LOWEST = {"transport_water": 0.0, "pour_water": -0.08, "pour_water_amount": -0.08}
FLEX_LOWEST = -0.05


# The usual actor, and pick and place where there are grippers.
ACTORS = [
    *((task, {}) for task in softgym_mj.TASKS),
    *(
        (task, {"actor": "pick_and_place"})
        for task, record in softgym_mj.TASKS.items()
        if "water" not in record.tags
    ),
]


@pytest.mark.parametrize(
    ("task", "settings"),
    ACTORS,
    ids=[f"{task}-{settings.get('actor', 'usual')}" for task, settings in ACTORS],
)
def test_a_hundred_random_episodes_raise_no_warning(task, settings):
    env = softgym_mj.load(task, split=range(100), observation=["full", "reduced"], **settings)
    random = np.random.default_rng(0)
    lowest = np.inf
    for variation in range(100):
        env.reset(variation)
        for _ in range(env.horizon):
            timestep = env.step(random.uniform(-1, 1, env.task.actor.action_size))
            assert np.isfinite(timestep.observation["full"]).all()
            lowest = min(lowest, env.task.points()[:, 2].min())
        assert timestep.last()
        assert env.info()["physics_warnings"] == 0
    assert lowest > LOWEST.get(task, FLEX_LOWEST)


@pytest.mark.parametrize("task", softgym_mj.TASKS)
def test_a_restore_takes_less_than_five_milliseconds(task):
    env = softgym_mj.load(task, split="evaluate", observation="full")
    env.reset(800)
    snapshot = env.get_state()
    times = []
    for _ in range(50):
        env.step(np.zeros(env.task.actor.action_size))
        start = time.perf_counter()
        env.set_state(snapshot)
        times.append(time.perf_counter() - start)
    assert np.median(times) < 5e-3


def scores_of_the_expert(task, **settings):
    """Final normalized performances (20,) of the scripted expert on variations 800..819."""
    env = softgym_mj.load(task, split="evaluate", **settings)
    scores = []
    for variation in range(800, 820):
        for _ in env.play(make_policy(env), variation):
            pass
        scores.append(env.info()["normalized_performance"])
    return scores


@pytest.mark.parametrize(
    ("task", "mean"),
    [
        ("straighten_rope", 0.95),
        ("rope_configuration", 0.7),
        ("spread_cloth", 0.8),
        ("fold_cloth", 0.9),
        ("fold_crumpled_cloth", 0.6),
        ("drop_cloth", 0.8),
        ("drop_fold_cloth", 0.7),
        ("transport_water", 0.99),
        ("pour_water", 0.9),
        ("pour_water_amount", 0.9),
    ],
)
def test_the_scripted_expert_solves_the_evaluation_variations(task, mean):
    assert np.mean(scores_of_the_expert(task)) >= mean


@pytest.mark.parametrize("actor", ["franka", "sawyer"])
@pytest.mark.parametrize(
    ("task", "mean", "least"),
    [("straighten_rope", 0.95, 0.7), ("fold_cloth", 0.88, 0.8), ("drop_cloth", 0.9, 0.8)],
)
def test_the_scripted_expert_solves_the_evaluation_variations_with_arms(task, mean, least, actor):
    scores = scores_of_the_expert(task, actor=actor)
    assert np.mean(scores) >= mean
    assert np.min(scores) >= least


def test_doing_nothing_scores_zero_on_a_cloth():
    env = softgym_mj.load("spread_cloth", split="evaluate")
    scores = []
    for variation in range(800, 820):
        timestep = env.reset(variation)
        while not timestep.last():
            timestep = env.step(np.zeros(8))
        scores.append(env.info()["normalized_performance"])
    assert abs(np.mean(scores)) < 0.02
    # Single piles go on slumping.
    np.testing.assert_allclose(scores, 0.0, atol=0.06)
