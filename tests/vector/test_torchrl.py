"""`TorchRLEnv` keeps to TorchRL's rules, and plays what the vector environment plays."""

import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError, UnexpectedArgumentError
from tests.kinds import by_material

SETTINGS = {"fidelity": "fast", "num_workers": 1, "split": "all"}
BACKENDS = [
    *by_material("host"),
    *(
        pytest.param(task, "cpu", marks=() if task == "transport_water" else pytest.mark.slow)
        for task in softgym_mj.TASKS
    ),
]


@pytest.fixture(name="make")
def _make():
    """Makes a `TorchRLEnv`; imports TorchRL, which takes seconds."""
    from softgym_mj.vector.torchrl import TorchRLEnv

    made = []
    yield lambda *args, **own: made.append(TorchRLEnv(*args, **own, **SETTINGS)) or made[-1]
    for env in made:
        env.close()


@pytest.mark.parametrize(("task", "device"), BACKENDS)
def test_specs(make, device, task):
    from torchrl.envs.utils import check_env_specs

    names = ["reduced", "full", "full_mask"]
    info = ["normalized_performance", "success"]
    env = make(task, 2, device=device, observation=names, info=info, horizon=3)
    check_env_specs(env, seed=0)


def test_images_are_bounded_as_in_gymnasium(make):
    from torchrl.data import Bounded
    from torchrl.envs.utils import check_env_specs

    env = make("straighten_rope", 2, device="cpu", observation=["rgb", "full"], image_size=(16, 16))
    rgb, full = (env.observation_spec[name] for name in ("rgb", "full"))
    assert isinstance(rgb, Bounded) and not isinstance(full, Bounded)
    assert rgb.dtype == torch.uint8 and rgb.space.low.amax() == 0 and rgb.space.high.amin() == 255
    np.testing.assert_array_equal(rgb.space.high, env.envs.observation_space["rgb"].high)
    check_env_specs(env, seed=0)


def test_it_plays_what_the_vector_environment_plays(make):
    env = make("straighten_rope", 3, device="host", horizon=2)
    envs = softgym_mj.make_vec("straighten_rope", 3, device="host", horizon=2, **SETTINGS)
    env.set_seed(5)
    first, _ = envs.reset(seed=5)
    now = env.reset()
    np.testing.assert_array_equal(now["observation"], first)
    for step in range(5):  # The third and fifth step come after a reset.
        actions = np.random.default_rng(step).uniform(-1, 1, (3, 8)).astype(np.float32)
        if step in (2, 4):
            envs.step(actions)
        now["action"] = torch.from_numpy(actions)
        ended, now = env.step_and_maybe_reset(now)
        observations, rewards, _, truncated, _ = envs.step(actions)
        np.testing.assert_array_equal(ended["next", "observation"], observations)
        np.testing.assert_allclose(ended["next", "reward"][:, 0], rewards, rtol=1e-6)
        np.testing.assert_array_equal(ended["next", "truncated"][:, 0], truncated)
    envs.close()


def test_actions_of_a_policy_need_no_detach(make):
    env = make("straighten_rope", 2, device="host", horizon=2)
    shift, states = torch.full((2, 8), 0.5), []
    for action in (shift, shift.clone().requires_grad_()):
        env.set_seed(1)
        now = env.reset()
        now["action"] = action
        states.append(env.step(now)["next", "observation"])
    assert states[0].equal(states[1])


def test_a_part_is_reset_alone(make):
    env = make("straighten_rope", 3, device="host", horizon=4)
    env.set_seed(1)
    now = env.rand_step(env.reset())
    before = now["next", "observation"].clone()
    mask = torch.tensor([[False], [True], [False]])
    part = now["next"].select(*env.observation_spec.keys(), *env.done_keys)
    part["_reset"] = mask
    after = env.reset(part)["observation"]
    assert (after == before).all(1).tolist() == [True, False, True]


def test_unknown_infos_and_numbers_are_refused(make):
    with pytest.raises(InvalidArgumentError, match="info='success' is not valid: expected a seq"):
        make("straighten_rope", 1, device="host", info="success")
    with pytest.raises(InvalidArgumentError, match="num_envs='two' is not valid: expected a whole"):
        make("straighten_rope", "two", device="host")
    env = make("straighten_rope", 1, device="host", info=["variations"])
    with pytest.raises(InvalidArgumentError, match=r"did you mean 'variation'.*'success'"):
        env.reset()
    with pytest.raises(UnexpectedArgumentError, match=r"'infos' \(did you mean 'info'\?\); valid"):
        make("straighten_rope", 1, device="host", infos=["success"])
    with pytest.raises(UnexpectedArgumentError, match="'autoreset_mode': TorchRL resets"):
        make("straighten_rope", 1, device="host", autoreset_mode="SameStep")
