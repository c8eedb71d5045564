"""Noise on actions: what was applied plays again, labels are what the expert would do."""

import hashlib
import pathlib

import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies.experts import make_policy
from softgym_mj.recording import dataset_name, record
from softgym_mj.recording.noise import disturbance

ROPE, NOISE = {"task": "straighten_rope", "observation": "reduced"}, 0.05
# Indices of the grips of two pickers, as on the data sheet.
GRIPS = [3, 7]

pytestmark = pytest.mark.usefixtures("own_datasets")


@pytest.mark.parametrize(
    "settings", [ROPE, {"task": "transport_water", "observation": "reduced", "fidelity": "fast"}]
)
def test_an_expert_in_a_second_environment_gives_the_labels(settings):
    dataset = record(variations=(3, 801), noise=NOISE, dataset="noisy-v0", **settings)
    env = dataset.recover_environment().unwrapped.dm_env
    for episode in dataset:
        expert, timestep = make_policy(env), env.reset(int(episode.infos["variation"][0]))
        for k, applied in enumerate(episode.actions):
            seen = timestep.observation["reduced"].astype(np.float32)
            np.testing.assert_array_equal(seen, episode.observations[k])
            own = expert(timestep).astype(np.float32)
            np.testing.assert_array_equal(own, episode.infos["expert_action"][k])
            timestep = env.step(applied)
            assert timestep.reward == episode.rewards[k]
        seen = timestep.observation["reduced"].astype(np.float32)
        np.testing.assert_array_equal(seen, episode.observations[-1])
        assert not np.array_equal(episode.actions, episode.infos["expert_action"])


def test_grips_and_what_rests_have_no_noise():
    episode = next(iter(record(variations=(0,), noise=NOISE, **ROPE)))
    own, applied = episode.infos["expert_action"], episode.actions
    assert own.shape == applied.shape and own.dtype == applied.dtype
    np.testing.assert_array_equal(own[:, GRIPS], applied[:, GRIPS])
    env = softgym_mj.load("straighten_rope", split="all")
    expert, timestep = make_policy(env), env.reset(0)
    for k, action in enumerate(applied):
        expert(timestep)
        assert expert.finished == np.array_equal(own[k], action)
        timestep = env.step(action)
    assert expert.finished and np.abs(applied).max() <= 1.0


def test_the_noise_is_gaussian_of_that_deviation():
    actor = softgym_mj.load("straighten_rope").task.actor
    disturb, motion = disturbance(actor, 0.2, 0, 0), np.setdiff1d(range(8), GRIPS)
    still = np.zeros(8, np.float32)
    drawn = np.array([disturb(still) for _ in range(4000)])
    assert drawn.dtype == np.float32 and not drawn[:, GRIPS].any()
    drawn = drawn[:, motion]
    # Standard errors: 0.2 / 4000^0.5 = 0.0032 of a mean, 0.2 / 8000^0.5 = 0.0022 of a deviation,
    # 1 / 4000^0.5 = 0.016 of a correlation; four of each.
    np.testing.assert_allclose(drawn.mean(0), 0.0, atol=0.0126)
    np.testing.assert_allclose(drawn.std(0), 0.2, atol=0.009)
    np.testing.assert_allclose(np.corrcoef(drawn.T), np.eye(len(motion)), atol=0.064)
    assert np.mean(np.abs(drawn) > 0.4) == pytest.approx(0.0455, abs=0.0054)  # Two deviations.
    ends = np.array([disturb(np.ones(8)) for _ in range(200)])
    assert ends.max() == 1.0 and 70 < (ends[:, 0] == 1.0).sum() < 130  # Half is clipped.


def test_a_cup_has_no_switches():
    actor = softgym_mj.load("pour_water").task.actor
    assert np.count_nonzero(disturbance(actor, 0.1, 0, 0)(np.zeros(3))) == 3


def _bytes(folder):
    files = sorted(path for path in pathlib.Path(folder).rglob("*.hdf5"))
    return [hashlib.sha256(path.read_bytes()).hexdigest() for path in files]


def test_the_same_bytes_from_any_number_of_processes(tmp_path, monkeypatch):
    result = []
    for name, jobs, settings in (
        ("one", 1, {"noise": 0.1}),
        ("two", 2, {"noise": 0.1}),
        ("seed", 1, {"noise": 0.1, "seed": 1}),
        ("none", 1, {"noise": 0.0}),
        ("usual", 1, {}),
    ):
        monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / name))
        dataset = record(
            variations=(4, 0, 801), jobs=jobs, horizon=5, dataset="a-v0", **settings, **ROPE
        )
        assert [int(episode.infos["variation"][0]) for episode in dataset] == [4, 0, 801]
        result.append(_bytes(tmp_path / name))
    one, two, seed, none, usual = result
    assert len(one) == 1 and one == two and none == usual
    assert len({*map(tuple, (one, seed, none))}) == 3
    assert all("expert_action" not in episode.infos for episode in dataset)


def test_episodes_have_noise_of_their_own():
    actor = softgym_mj.load("straighten_rope").task.actor
    drawn = {
        tuple(disturbance(actor, 0.1, seed, variation)(np.zeros(8)))
        for seed in range(3)
        for variation in range(3)
    }
    assert len(drawn) == 9


def test_ids_tell_the_noise():
    assert dataset_name("lift", "scripted", noise=0.05) == "softgym_mj/lift/scripted-noise0-05-v0"
    dataset = record(variations=(0,), noise=0.05, horizon=2, actor="picker", **ROPE)
    assert dataset.spec.dataset_id == "softgym_mj/straighten_rope/scripted-picker-noise0-05-v0"


@pytest.mark.parametrize("noise", [-0.1, 1.5, float("nan"), "much"])
def test_bad_noise_is_refused(noise, tmp_path):
    with pytest.raises(InvalidArgumentError, match="noise="):
        record(variations=(0,), noise=noise, on_episode=pytest.fail, **ROPE)
    assert not list(tmp_path.iterdir())


def test_random_actions_have_no_noise():
    with pytest.raises(InvalidArgumentError, match=r"noise=0\.1 .*0 with policy='random'"):
        record(policy="random", variations=(0,), noise=0.1, on_episode=pytest.fail, **ROPE)
