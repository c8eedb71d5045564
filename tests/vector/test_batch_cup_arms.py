"""Rows of arrays with cups in hands: their oracle is the environment with the same arm."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.batch.device import CpuDevice
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.rendering.observables import LABELS
from softgym_mj.vector.batch.cameras import IMAGES
from tests.native.torch_device import TorchDevice
from tests.vector import arms
from tests.vector.arms import STEPS, VARIATIONS
from tests.vector.same import same

pytest.importorskip("jax", reason="needs the extra gpu-arms")

TASK = "transport_water"
SETTINGS = {
    "observation": ["full", "markov", "proprioception", "reduced"],
    "split": VARIATIONS,
    "actor": "franka",
    "fidelity": "fast",
}


def _make(task=TASK, **settings):
    return softgym_mj.make_vec(task, 3, device="host", **{**SETTINGS, **settings})


def _random(number):
    return np.random.default_rng(0).uniform(-1.0, 1.0, (number, 3, 1))


@pytest.mark.long
def test_threads_change_no_bit():
    outcomes = []
    for threads in (1, 2):
        envs = arms.batch(CpuDevice(num_threads=threads), TASK, **SETTINGS)
        outcomes.append([arms.reset(envs), *(envs.step(each) for each in _random(4))])
        envs.close()
    assert same(*outcomes)


LONG = "pour_water/franka", "pour_water_amount/sawyer", "pour_water/ur5e"


@pytest.mark.parametrize(
    "case", [f"{TASK}/franka", *(pytest.param(c, marks=pytest.mark.long) for c in LONG)]
)
def test_an_expert_acts_as_in_environments(case):
    task, actor = case.split("/")
    settings = {"actor": actor, **({} if case in LONG else {"horizon": 2 * STEPS})}
    episodes = arms.recorded(softgym_mj.load(task, **{**SETTINGS, **settings}))
    envs, sensed = _make(task, autoreset_mode="Disabled", **settings), []
    for k, (observations, infos) in enumerate(arms.replayed(envs, episodes, rtol=1e-5)):
        sensed.append(observations["proprioception"].astype(float))
        for i, (_, seen) in enumerate(episodes):
            for name in ("rejected_moves", "ik_failures", "physics_warnings"):
                assert infos[name][i] == seen[k + 1][1][name]
            if k < STEPS:
                markov = seen[k + 1][0]["markov"]
                np.testing.assert_allclose(observations["markov"][i], markov, atol=5e-3)
    found, expected = np.array(sensed), arms.sensed(episodes)
    # The largest entry of a quaternion is positive; of two alike, rounding chooses.
    turns = expected[..., 3:7]
    turns *= np.sign((turns * found[..., 3:7]).sum(-1, keepdims=True))
    differences = np.abs(found - expected)
    joints = (differences.shape[-1] - 8) // 2
    assert differences[:STEPS, :, :3].max() < 1e-4  # [m] Tool points.
    assert differences[:STEPS, :, 8 : 8 + joints].max() < 1e-4  # [rad]
    assert differences[..., : 8 + joints].max() < 2e-3  # Water is chaotic in the end.
    scores = [seen[-1][1]["normalized_performance"] for _, seen in episodes]
    np.testing.assert_allclose(infos["normalized_performance"], scores, atol=0.03)


@pytest.mark.parametrize("steps", [0, pytest.param(2, marks=pytest.mark.long)])
def test_images_show_cups_in_hands_as_in_environments(steps):
    settings = {"observation": list(IMAGES), "image_size": (72, 64)}
    envs = _make("pour_water", **settings)
    env = SoftGymEnv("pour_water", **{**SETTINGS, **settings})
    # Glass before the camera is brighter.
    seen, _ = arms.check_pictures(envs, env, [0.5, 1.0, 0.5], [steps], wrist=20.0)
    for name in ("actor", "container"):
        assert (seen["segmentation"] == LABELS.index(name)).mean() > 0.03


def test_snapshots_go_to_environments_and_back():
    envs, alone = _make(), SoftGymEnv(TASK, **SETTINGS)
    arms.reset(envs)
    arms.check_snapshots(envs, alone, _random(8).astype(np.float32), atol=1e-4)


@pytest.mark.parametrize("mode", ["NextStep", pytest.param("SameStep", marks=pytest.mark.long)])
def test_tensors_are_arrays_and_episodes_follow_each_other(mode):
    settings = {**SETTINGS, "horizon": 3, "observation": "full"}
    both = (arms.batch(device, TASK, mode, **settings) for device in (CpuDevice(), TorchDevice()))
    arms.check_tensors(*both, _random(5))


def test_bad_actions_and_diverging_arms_end_one_environment_alone():
    arms.check_failures(lambda: arms.batch(TorchDevice(), TASK, **SETTINGS), _random(5))


def test_what_batches_cannot_do_with_cups_in_hands_is_refused(monkeypatch):
    arms.check_refusals(monkeypatch, "softgym_mj.vector.batch.cup_arms", _make)
