"""Replays: their oracle is a loop over episodes that are written down."""

import numpy as np
import torch

import softgym_mj
from softgym_mj.learning import replay as replays
from softgym_mj.learning.learner import Step
from softgym_mj.learning.replay import Replay
from softgym_mj.learning.symmetries import symmetries

SEEDS, NUM_ENVS, DISCOUNT = [3, 8], 2, 0.5


def _step(t, ended=False, terminated=False):
    """Numbers that say when and where they are from."""
    at = torch.arange(len(SEEDS) * NUM_ENVS, dtype=torch.float32)
    seen = torch.stack([torch.full_like(at, t), at], -1)
    following = torch.stack([torch.full_like(at, t + 0.5), at], -1)
    flags = (torch.full_like(at, flag, dtype=torch.bool) for flag in (terminated, ended))
    arrays = seen, (100.0 * at + t)[:, None], torch.full_like(at, 2.0**t), following, *flags
    return Step(*(array.reshape(len(SEEDS), NUM_ENVS, *array.shape[1:]) for array in arrays))


def _replay(capacity=10, **settings):
    return Replay(capacity, SEEDS, NUM_ENVS, (2,), 1, discount=DISCOUNT, **settings)


def test_rewards_are_added_up_to_the_end_of_an_episode():
    replay = _replay(steps=3)
    ends = {2: (True, False), 5: (True, True)}
    for t in range(9):
        replay.add(_step(t, *ends.get(t, (False, False))))
    batch = replay.sample(400)
    seen = set()
    for k in range(2):
        for i in range(400):
            t, env_index = batch.observation[k, i].tolist()
            seen.add((k, t, env_index))
            assert env_index // NUM_ENVS == k
            assert batch.action[k, i].item() == 100.0 * env_index + t
            reward, factor, last, lives = 0.0, 1.0, t, 1.0
            for n in range(3):
                last = t + n
                reward += factor * 2.0**last
                factor *= DISCOUNT
                ended, terminated = ends.get(last, (False, False))
                lives = 0.0 if terminated else 1.0
                if ended:
                    break
            assert batch.reward[k, i].item() == reward
            assert batch.next_observation[k, i].tolist() == [last + 0.5, env_index]
            assert batch.discount[k, i].item() == factor * lives
    assert len(seen) == 2 * 7 * 2  # 7 vector steps that three begin with, 2 environments each.


def test_stretches_are_of_one_environment_and_in_order():
    replay = _replay(capacity=6)
    for t in range(9):
        replay.add(_step(t, ended=t == 5))
    result = replay.slices(200, 3)
    times, places = result.observation[..., 0], result.observation[..., 1]
    assert set(times[..., 0].ravel().tolist()) == {3.0, 4.0, 5.0, 6.0}
    assert torch.equal(times, times[..., :1] + torch.arange(3.0))
    assert torch.equal(places, places[..., :1].expand(2, 200, 3))
    assert torch.equal(places[..., 0] // NUM_ENVS, torch.arange(2.0)[:, None].expand(2, 200))
    assert torch.equal(result.ended, times == 5.0)
    assert torch.equal(result.action[..., 0], 100.0 * places + times)


def test_the_oldest_make_way():
    replay = _replay(capacity=4, steps=2)
    for t in range(11):
        replay.add(_step(t))
    result = replay.sample(200).observation[..., 0]
    assert set(result.ravel().tolist()) == {7.0, 8.0, 9.0}
    assert replay.size == 4


def test_a_state_has_the_newest_images(monkeypatch, caplog):
    monkeypatch.setattr(replays, "NEWEST_IMAGES", 5)
    first, second = (Replay(6, [0], 2, (1, 1, 3), 1, discount=0.9) for _ in range(2))
    no = torch.zeros(1, 2, dtype=torch.bool)
    for t in range(8):
        seen = torch.full((1, 2, 1, 1, 3), t, dtype=torch.uint8)
        first.add(Step(seen, torch.zeros(1, 2, 1), torch.full((1, 2), float(t)), seen + 1, no, no))
    with caplog.at_level("INFO"):
        second.set_state(first.get_state())
    assert "newest 3 of 6" in caplog.text  # Vector steps of two environments each.
    batch = second.sample(200)
    assert set(batch.reward.ravel().tolist()) == {5.0, 6.0, 7.0}
    assert torch.equal(batch.observation[..., 0, 0, 0].float(), batch.reward)
    second.add(Step(seen, torch.zeros(1, 2, 1), torch.full((1, 2), 9.0), seen, no, no))
    assert set(second.sample(200).reward.ravel().tolist()) == {5.0, 6.0, 7.0, 9.0}


def test_steps_are_shown_by_symmetries():
    env = softgym_mj.load("straighten_rope", split="all", fidelity="fast")
    env.reset(3)
    result = symmetries(env, "reduced")
    sizes = len(result[0].observation), len(result[0].action)
    replay = Replay(4, [0], 1, sizes[:1], sizes[1], discount=0.9, symmetries=result)
    source = np.random.default_rng(0)
    observation, following, action = (source.normal(size=n) for n in (sizes[0], *sizes))
    seen, done, later = (
        torch.tensor(value[None, None]).float() for value in (observation, action, following)
    )
    no = torch.zeros(1, 1, dtype=torch.bool)
    replay.add(Step(seen, done, torch.ones(1, 1), later, no, no))
    batch = replay.sample(300)
    shown = set()
    for i in range(300):
        away = [
            np.abs(s.observation @ observation - batch.observation[0, i].numpy()).max()
            for s in result
        ]
        k = int(np.argmin(away))
        shown.add(k)
        for value, own, matrix in (
            (observation, batch.observation, result[k].observation),
            (following, batch.next_observation, result[k].observation),
            (action, batch.action, result[k].action),
        ):
            np.testing.assert_allclose(own[0, i].numpy(), matrix @ value, atol=1e-5)
    assert len(shown) == len(result)
