"""Rows of arrays with cups in hands: their oracle is the environment with the same arm."""

import sys

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode

import softgym_mj
from softgym_mj.batch.device import CpuDevice
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError, UnavailableError
from softgym_mj.rendering.observables import LABELS, WRIST_RGB
from softgym_mj.vector.base import VectorEnv
from softgym_mj.vector.batch.backend import BatchBackend
from softgym_mj.vector.batch.cameras import IMAGES
from tests.native.torch_device import TorchDevice
from tests.vector.arms import check_snapshots, recorded
from tests.vector.same import same
from tests.vector.test_images import check_images

pytest.importorskip("jax", reason="needs the extra gpu-arms")

# JAX compiles once for all batches of three environments with an arm on the same mount.
TASK, VARIATIONS = "transport_water", [800, 801, 802]
SETTINGS = {
    "observation": ["full", "markov", "proprioception", "reduced"],
    "split": VARIATIONS,
    "actor": "franka",
    "fidelity": "fast",
}
STEPS = 20  # Env steps over which paths of the arms are compared.


def _make(task=TASK, **settings):
    return softgym_mj.make_vec(task, 3, device="host", **{**SETTINGS, **settings})


def _on(device, mode="NextStep", **settings):
    """A batch on a device."""
    env = SoftGymEnv(TASK, **{**SETTINGS, **settings})
    return VectorEnv(BatchBackend(env, 3, device), VARIATIONS, AutoresetMode(mode))


def _reset(envs, **options):
    return envs.reset(seed=0, options={"variation": VARIATIONS, **options})


def _random(number):
    return np.random.default_rng(0).uniform(-1.0, 1.0, (number, 3, 1))


def _recorded(task, **settings):
    """An expert's episodes on the CPU: actions, observations and infos of each variation."""
    return recorded(softgym_mj.load(task, **{**SETTINGS, **settings}), VARIATIONS)


def test_threads_change_no_bit():
    outcomes = []
    for threads in (1, 2):
        envs = _on(CpuDevice(num_threads=threads))
        outcomes.append([_reset(envs), *(envs.step(each) for each in _random(4))])
        envs.close()
    assert same(*outcomes)


LONG = "pour_water/franka", "pour_water_amount/sawyer", "pour_water/ur5e"


@pytest.mark.parametrize(
    "case", [f"{TASK}/franka", *(pytest.param(c, marks=pytest.mark.long) for c in LONG)]
)
def test_an_expert_acts_as_in_environments(case):
    task, actor = case.split("/")
    settings = {"actor": actor, **({} if case in LONG else {"horizon": 2 * STEPS})}
    episodes = _recorded(task, **settings)
    envs, sensed = _make(task, autoreset_mode="Disabled", **settings), []
    observations, infos = _reset(envs)
    for i, (_, seen) in enumerate(episodes):
        for name, array in seen[0][0].items():
            np.testing.assert_allclose(observations[name][i], array, rtol=1e-5, err_msg=name)
        assert {name for name in infos if not name.startswith("_")} == set(seen[0][1])
    for k in range(envs.get_attr("horizon")[0]):
        observations, *_, infos = envs.step(np.array([actions[k] for actions, _ in episodes]))
        sensed.append(observations["proprioception"].astype(float))
        for i, (_, seen) in enumerate(episodes):
            for name in ("rejected_moves", "ik_failures", "physics_warnings"):
                assert infos[name][i] == seen[k + 1][1][name]
            if k < STEPS:
                markov = seen[k + 1][0]["markov"]
                np.testing.assert_allclose(observations["markov"][i], markov, atol=5e-3)
    expected = np.array(
        [[each["proprioception"] for each, _ in seen[1:]] for _, seen in episodes]
    ).swapaxes(0, 1)
    differences = np.abs(np.array(sensed) - expected)
    joints = (differences.shape[-1] - 8) // 2
    assert differences[:STEPS, :, :3].max() < 1e-4  # [m] Tool points.
    assert differences[:STEPS, :, 8 : 8 + joints].max() < 1e-4  # [rad]
    assert differences[..., : 8 + joints].max() < 2e-3  # Water is chaotic in the end.
    scores = [seen[-1][1]["normalized_performance"] for _, seen in episodes]
    np.testing.assert_allclose(infos["normalized_performance"], scores, atol=0.03)
    envs.close()


@pytest.mark.parametrize("steps", [0, pytest.param(2, marks=pytest.mark.long)])
def test_images_show_cups_in_hands_as_in_environments(steps):
    settings = {"observation": list(IMAGES), "image_size": (72, 64)}
    envs = _make("pour_water", **settings)
    env = SoftGymEnv("pour_water", **{**SETTINGS, **settings})
    (seen, _), (alone, _) = _reset(envs), env.reset(options={"variation": VARIATIONS[1]})
    action = np.array([0.5, 1.0, 0.5], np.float32)
    for _ in range(steps):
        seen, alone = envs.step(np.stack([action] * 3))[0], env.step(action)[0]
    check_images({name: array[1] for name, array in seen.items()}, alone, color=5.0)
    wrists = seen[WRIST_RGB][1].astype(float), alone[WRIST_RGB]
    assert np.abs(np.subtract(*wrists)).mean() < 20.0  # Glass before the camera is brighter.
    for name in ("actor", "container"):
        assert (seen["segmentation"][1] == LABELS.index(name)).mean() > 0.03
    envs.close()
    env.close()


def test_snapshots_go_to_environments_and_back():
    envs, alone = _make(), SoftGymEnv(TASK, **SETTINGS)
    _reset(envs)
    check_snapshots(envs, alone, _random(8).astype(np.float32), atol=1e-4)


@pytest.mark.parametrize("mode", ["NextStep", pytest.param("SameStep", marks=pytest.mark.long)])
def test_tensors_are_arrays_and_episodes_follow_each_other(mode):
    outcomes = []
    for device in (CpuDevice(), TorchDevice()):
        envs = _on(device, mode, horizon=3, observation="full")
        _reset(envs)
        outcomes.append([])
        for k, each in enumerate(_random(5)):
            own = torch.from_numpy(each) if device.xp_device else each
            seen, rewards, _, truncated, _ = envs.step(own)
            outcomes[-1].append((np.asarray(seen), np.asarray(rewards)))
            assert np.asarray(truncated).all() == (k == 2)
        envs.close()
    for ours, theirs in zip(*outcomes, strict=True):
        for array, other in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(other, array, rtol=1e-5, atol=1e-6)


def test_bad_actions_and_diverging_arms_end_one_environment_alone():
    outcomes = []
    for spoils in (False, True):
        envs = _on(TorchDevice())
        _reset(envs)
        outcomes.append([])
        for k, each in enumerate(torch.from_numpy(_random(5))):
            bad = spoils and k in (1, 3)
            if spoils and k == 1:
                each[1, 0] = torch.nan
            if spoils and k == 3:
                envs.backend._physics.state["arms"]["speeds"][1] = torch.inf
            seen, _, terminated, _, infos = envs.step(each)
            assert terminated.tolist() == [False, bad, False]
            assert infos["physics_warnings"][[0, 2]].tolist() == [0, 0]
            assert all(array.isfinite().all() for array in seen.values())
            outcomes[-1].append({name: array[[0, 2]].numpy() for name, array in seen.items()})
        envs.close()
    assert same(*outcomes)


def test_what_batches_cannot_do_with_cups_in_hands_is_refused(monkeypatch):
    with pytest.raises(InvalidArgumentError, match=r"action_repeat=3 \(odd\) with arms"):
        _make(action_repeat=3)
    monkeypatch.delitem(sys.modules, "softgym_mj.vector.batch.cup_arms")
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(UnavailableError, match=r"JAX is missing.*gpu-arms"):
        _make()
