"""Hindsight: its oracles are a loop over episodes that are written down, and the task itself."""

import dataclasses
import functools
import types

import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.methods import hindsight
from softgym_mj.learning.methods.hindsight import HindsightReplay, HindsightSAC, HindsightSettings
from softgym_mj.learning.networks import drawn, generators
from softgym_mj.learning.off_policy import OffPolicy
from softgym_mj.learning.registry import find_method
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.training import Training
from softgym_mj.metrics import Measures
from softgym_mj.tasks import pour_water_amount
from softgym_mj.tasks.rope_configuration import RopeGoals
from softgym_mj.tasks.shared.entries import points
from softgym_mj.tasks.shared.goals import goals

SEEDS, NUM_ENVS, CAPACITY, STEPS, DISCOUNT, SCALE = [3, 8], 2, 10, 14, 0.5, 2.0
ENDS = {5: (True, False), 9: (True, True), 12: (True, False)}  # Ended, terminated.


@pytest.fixture(name="rope", scope="module")
def _rope():
    env = softgym_mj.load("rope_configuration", split="all", fidelity="fast", random_state=0)
    env.reset(7)
    return goals("rope_configuration", env.task)


def _numbers(rope, seed, number, *shape):
    """Full states whose pickers say which they are."""
    result = np.random.default_rng(seed).normal(size=(*shape, number)).astype(np.float32)
    return torch.from_numpy(result)


def _steps(rope, seeds=SEEDS):
    """Vector steps; the rope of each is elsewhere, and the goal is the episode's."""
    size = 3 * rope.task.max_points
    result, episode = [], 0
    for t in range(STEPS):
        ended, terminated = ENDS.get(t, (False, False))
        each = []
        for seed in seeds:
            goal = _numbers(rope, 100 * seed + episode, size, NUM_ENVS)
            both = [_numbers(rope, 10_000 * seed + 2 * t + k, size, NUM_ENVS) for k in range(2)]
            where = torch.tensor([[t, w, seed, 0.0, 0.0, 0.0] for w in range(NUM_ENVS)])
            each.append([torch.cat([points, goal, where], -1) for points in both])
        seen, following = (torch.stack(pair) for pair in zip(*each, strict=True))
        lead = len(seeds), NUM_ENVS
        zeros, flags = torch.zeros(lead), torch.ones(lead, dtype=torch.bool)
        step = Step(
            seen, torch.zeros(*lead, 8), zeros, following, flags & terminated, flags & ended
        )
        result.append(step)
        episode += ended
    return result


def _replay(rope, seeds=SEEDS, **settings):
    size = rope.task.observe("full").size
    replay = HindsightReplay(
        CAPACITY, seeds, NUM_ENVS, (size,), 8, discount=DISCOUNT,
        **{"of": rope, "horizon": 6, "reward_scale": SCALE, "share": 0.8,
           "steps": 2, **settings},
    )  # fmt: skip
    for step in _steps(rope, seeds):
        replay.add(step)
    return replay


def _alone(rope, full):
    """The state and the goal of one full state, by NumPy."""
    return rope.read(full.double().numpy())


def test_goals_are_reached_later_and_measured_by_the_task(rope):
    steps, batch = _steps(rope), _replay(rope).sample(150)
    seen, relabeled = {}, 0
    count = 3 * len(rope.task.rope.key_points)
    for k, i in np.ndindex(len(SEEDS), 150):
        t, env_index = (int(value) for value in batch.observation[k, i, -6:-4])
        last = min(end for end in [*ENDS, STEPS - 1] if end >= t)
        key_points = batch.observation[k, i, count : 2 * count]
        assert torch.equal(batch.next_observation[k, i, count : 2 * count], key_points)
        candidates = {j: steps[j].next_observation[k, env_index] for j in range(t, last + 1)}
        reached = {j: _alone(rope, full)[0].points["rope"] for j, full in candidates.items()}
        reached["own"] = _alone(rope, steps[t].observation[k, env_index])[1].goal["rope"]
        chosen = [
            name for name, goal in reached.items()
            if np.array_equal(goal[rope.task.rope.key_points].ravel(), key_points.double().numpy())
        ]  # fmt: skip
        assert len(chosen) == 1
        relabeled += chosen[0] != "own"
        seen.setdefault((t, last), set()).add(chosen[0])
        expected = 0.0
        for n in range(2):
            following = steps[t + n].next_observation[k, env_index]
            state, episode = _alone(rope, following)
            other = dataclasses.replace(episode, goal={"rope": reached[chosen[0]]})
            expected += DISCOUNT**n * SCALE * rope.task.measure(state, other).reward
            if t + n == last or t + n == STEPS - 1:
                break
        assert batch.reward[k, i].item() == pytest.approx(expected, rel=1e-5)
        lives = 0.0 if ENDS.get(t + n, (False, False))[1] else 1.0
        assert batch.discount[k, i].item() == DISCOUNT ** (n + 1) * lives
    assert 0.74 < relabeled / 300 < 0.86
    assert {t for t, _ in seen} == set(range(STEPS - CAPACITY, STEPS - 1))
    for (t, last), names in seen.items():
        assert names == {"own", *range(t, last + 1)}


@pytest.mark.parametrize("name", ["rope_configuration", "pour_water_amount"])
def test_full_states_say_all_that_is_measured(name, monkeypatch):
    env = softgym_mj.load(name, split="all", fidelity="fast", random_state=0)
    for variation in (3, 812):
        env.reset(variation)
        task = env.task
        for _ in range(20):
            env.step(np.full(task.actor.action_size, 0.6))
        of = goals(name, task)
        full = torch.from_numpy(task.observe("full")).expand(2, 3, -1)
        state, episode = of.read(full)
        reward = task.measure(state, episode).reward
        np.testing.assert_allclose(reward, np.full((2, 3), task.last_evaluation.reward), atol=1e-9)
        reduced = hindsight.reduced(of, full)
        np.testing.assert_allclose(reduced[1, 2], task.observe("reduced"), atol=1e-6)
        other = of.reached(state, episode)
        best = task.measure(state, dataclasses.replace(episode, goal=other)).reward
        np.testing.assert_array_equal(best, np.zeros((2, 3)))
        if name == "pour_water_amount":
            share = other["share"][0, 0].item()
            monkeypatch.setattr(pour_water_amount, "goal_share", lambda _, share=share: share)
            level = task.goal(variation, task.episode.points)["level"]
            assert other["level"][0, 0].item() == pytest.approx(float(level), abs=1e-6)
            monkeypatch.undo()
    env.close()


METHOD = find_method(
    "sac_hindsight", hidden=(16, 16), random_steps=8, updates=2, batch=8, replay=24, symmetric=True
)
SETTINGS = TrainingSettings(
    "rope_configuration", observation="full", env_steps=24, num_envs=2, part=8, evaluate_every=3,
    episodes=1, final_episodes=1, fidelity="fast", episode_steps=6,
)  # fmt: skip


class _Reach(RopeGoals):
    """A point in a square is to reach another: 0 where it is near, else -1."""

    def __init__(self):
        def measure(state, episode):
            away = (state.points["rope"] - episode.goal["rope"])[..., 0, :2].norm(dim=-1)
            reward = -(away > 0.1).double()
            return Measures(reward, {"reach": reward})

        def reduced(state, episode):
            goal = points(episode.goal["rope"], "goal")
            return {"point": points(state.points["rope"], "object"), "goal": goal}

        actor = types.SimpleNamespace(ends_states=False)
        seen = {"full": np.zeros(6), "reduced": np.zeros(6)}
        super().__init__(
            types.SimpleNamespace(
                max_points=1, measure=measure, reduced=reduced, actor=actor, observe=seen.get
            )
        )


@pytest.mark.long
def test_it_learns_to_reach_points_that_it_hardly_ever_meets():
    settings = HindsightSettings(
        hidden=(32, 32), discount=0.9, actor_rate=4e-3, critic_rate=4e-3, alpha_rate=4e-3,
        tau=0.05, actor_every=1, target_every=1, updates=4, batch=64, random_steps=320,
        replay=8_000, alpha=0.05,
    )  # fmt: skip
    seeds, num_envs, horizon, of = [0, 1], 16, 10, _Reach()
    sac = HindsightSAC(settings, seeds, of, 2)
    replay = functools.partial(HindsightReplay, of=of, horizon=horizon, reward_scale=1.0, share=0.8)
    problem = Problem("toy", {}, seeds, num_envs, (6,), 2, 1.0, "cpu")
    learner, sources = OffPolicy(settings, problem, sac, replay), generators([5, 6], "cpu")

    def episodes(number, explore):
        point = torch.zeros(2, number, 3)
        goal = 2.0 * drawn(sources, number, 3, normal=False) - 1.0
        for t in range(horizon):
            seen = torch.cat([point, goal], -1)
            action, _ = learner.act(seen, torch.full(seen.shape[:2], t == 0), None, explore=explore)
            point = torch.cat([(point[..., :2] + 0.25 * action).clamp(-1, 1), point[..., 2:]], -1)
            following = torch.cat([point, goal], -1)
            reward = of.task.measure(*of.read(following)).reward
            if explore:
                ended = torch.full(reward.shape, t == horizon - 1)
                learner.learn(Step(seen, action, reward, following, ended & False, ended))
        return reward

    assert episodes(200, False).mean() < -0.9
    for _ in range(20):
        episodes(num_envs, True)
    assert episodes(200, False).mean() > -0.6  # Without hindsight it stays as it was.


def test_what_cannot_be_is_refused(tmp_path):
    for settings, match in (
        ({"observation": "reduced"}, "observation"),
        ({"task": "straighten_rope"}, "task='straighten_rope'"),
    ):
        other = dataclasses.replace(SETTINGS, **settings)
        with pytest.raises(InvalidArgumentError, match=match):
            Training(other, METHOD, [0], tmp_path, "host")
