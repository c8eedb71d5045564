"""Demonstrations: their oracle is the expert in the environment, step by step."""

import dataclasses
import pickle

import numpy as np
import pytest
import torch

from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning import demonstrations
from softgym_mj.learning.demonstrations import collect, replay_of
from softgym_mj.learning.learner import Problem, Step
from softgym_mj.learning.symmetries import Symmetry
from softgym_mj.parallel.executors import Executor
from softgym_mj.policies.experts import make_policy

SETTINGS = {"fidelity": "fast"}
PROBLEM = Problem("straighten_rope", SETTINGS, [0], 1, (36,), 8, 5.0, "cpu")


@pytest.fixture(name="cache")
def _cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(tmp_path))
    return tmp_path


def _equal(one, other):
    return all(map(torch.equal, one, other))


def test_they_are_what_the_expert_does(cache):
    shown = collect(PROBLEM, 2, 1)
    env = SoftGymEnv("straighten_rope", observation="reduced", split="all", **SETTINGS)
    assert shown.observation.shape == (2, env.horizon, 36)
    assert shown.action.shape == (2, env.horizon, 8)
    for variation in range(2):
        seen, _ = env.reset(options={"variation": variation})
        act, timestep = make_policy(env.dm_env), env.dm_env.reset(variation)
        for k in range(env.horizon):
            assert np.array_equal(shown.observation[variation, k], seen)
            action = act(timestep).astype(np.float32)
            assert np.array_equal(shown.action[variation, k], action)
            timestep = env.dm_env.step(action)
            seen = timestep.observation["reduced"].astype(np.float32)
            assert shown.reward[variation, k] == pytest.approx(5.0 * timestep.reward, rel=1e-6)
            assert np.array_equal(shown.next_observation[variation, k], seen)
        assert env.dm_env.info()["normalized_performance"] > 0.9
    assert not shown.terminated.any()
    assert shown.ended[:, -1].all() and not shown.ended[:, :-1].any()


def test_what_was_killed_goes_on_from_what_is_there(cache, monkeypatch):
    whole = collect(PROBLEM, 3, 1)
    for file in cache.glob("demonstrations/*/000[12].value"):
        file.unlink()
    calls = []

    def written():
        """When the files were written, by the episodes' numbers."""
        return {int(f.stem): f.stat().st_mtime_ns for f in cache.glob("demonstrations/*/*.value")}

    (first,) = written().items()

    def kill(text, *numbers):
        if text == "%d of %d demonstrations":
            calls.append(numbers)
            if numbers[0] == 2:
                raise KeyboardInterrupt

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(demonstrations._log, "info", kill)
        collect(PROBLEM, 3, 1)
    before = written()
    assert calls == [(1, 3), (2, 3)] and {*before} == {0, 1} and first in before.items()
    assert _equal(collect(PROBLEM, 3, 1), whole)
    assert {*written()} == {0, 1, 2} and before.items() < written().items()
    # Other settings have other files; fewer episodes are the first ones.
    full = collect(dataclasses.replace(PROBLEM, observed="full"), 1, 1)
    assert full.observation.shape[-1] > 36
    assert torch.equal(full.action, collect(PROBLEM, 1, 1).action)


def test_another_expert_has_other_files(cache, monkeypatch):
    first = collect(PROBLEM, 1, 1)
    monkeypatch.setattr(demonstrations, "sources_sha256", lambda task: f"other {task.name}")
    assert _equal(collect(PROBLEM, 1, 1), first)
    files = [*cache.glob("demonstrations/*/*.value")]
    assert len({file.parent for file in files}) == len(files) == 2


class _Elsewhere(Executor):
    """Makes calls as another process does: of what is pickled."""

    number = 3

    def results(self, function, calls):
        for index, call in reversed([*enumerate(calls)]):
            yield index, pickle.loads(pickle.dumps(function))(*call)

    def close(self):
        pass


def test_processes_change_nothing(cache, monkeypatch):
    here = collect(PROBLEM, 2, 1)
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(cache / "other"))
    workers = []
    monkeypatch.setattr(
        demonstrations, "make_executor", lambda jobs: workers.append(jobs) or _Elsewhere()
    )
    assert _equal(collect(PROBLEM, 2, 3), here)
    collect(PROBLEM, 2)
    assert workers == [3, demonstrations.num_cores()]


def _toy(episodes=3, steps=4):
    """Observations are (episode, step); rewards are 1, 10, 100, ..."""
    places = torch.cartesian_prod(torch.arange(float(episodes)), torch.arange(float(steps + 1)))
    places = places.reshape(episodes, steps + 1, 2)
    seen, following = places[:, :-1], places[:, 1:]
    over = torch.zeros(episodes, steps, dtype=torch.bool)
    ended = over.clone()
    ended[:, -1] = True
    action = 0.1 * seen.sum(-1, keepdim=True)
    return Step(seen, action, 10.0 ** seen[..., 1], following, over, ended)


def test_batches_are_of_steps_that_follow_each_other():
    replay = replay_of(_toy(), [3, 8], discount=0.5, steps=2)
    batch = replay.sample(200)
    start = batch.observation[..., 1]
    assert {(e, k) for e, k in batch.observation[0].tolist()} == {
        (float(e), float(k)) for e in range(3) for k in range(3)
    }
    torch.testing.assert_close(batch.action[..., 0], 0.1 * batch.observation.sum(-1))
    torch.testing.assert_close(batch.reward, 10.0**start * (1.0 + 0.5 * 10.0))
    moved = batch.observation + torch.tensor([0.0, 2.0])
    torch.testing.assert_close(batch.next_observation, moved)
    assert (batch.discount == 0.25).all()
    alone = replay_of(_toy(), [8], discount=0.5, steps=2).sample(200)
    assert torch.equal(alone.observation[0], batch.observation[1])
    assert not torch.equal(batch.observation[0], batch.observation[1])


def test_symmetries_show_them_otherwise():
    swap = Symmetry(np.eye(2)[::-1].copy(), -np.eye(1), np.eye(3), "same", (0,))
    same = Symmetry(np.eye(2), np.eye(1), np.eye(3), "same", (0,))
    batch = replay_of(_toy(2, 6), [0], symmetries=[same, swap]).sample(400)
    turned = batch.action[..., 0] < 0.0
    assert 120 < turned.sum() < 220  # About half, of which a twelfth has no action.
    assert (batch.observation[turned][:, 1] <= 1.0).all()  # The episode comes second.
    assert (batch.observation[turned][:, 0].unique() > 1.0).any()
    with pytest.raises(InvalidArgumentError, match="symmetric"):
        replay_of(_toy(), [0], symmetries=[Symmetry(np.eye(3), *same[1:])])
