"""The contract of Gymnasium's vector interface, of which it ships no checker, by both backends."""

import numpy as np
import pytest
from gymnasium.vector.utils import batch_space

import softgym_mj
from tests.kinds import by_material

NUMBER, HORIZON = 2, 3
BACKENDS = [
    *by_material("host"),
    *(
        pytest.param(task, "cpu", marks=() if task == "pour_water" else pytest.mark.slow)
        for task in softgym_mj.TASKS
    ),
]


def _check_infos(infos):
    """Infos are arrays with a row for each, and who has one."""
    for name, values in infos.items():
        if not name.startswith("_"):
            assert len(values) == NUMBER
            mask = infos[f"_{name}"]
            assert mask.shape == (NUMBER,) and mask.dtype == bool


@pytest.mark.parametrize(("task", "device"), BACKENDS)
def test_it_keeps_to_the_interface(device, task):
    settings = {"horizon": HORIZON, "fidelity": "fast", "split": "all", "num_workers": 1}
    names = ["reduced", "full", "full_mask"]
    envs = softgym_mj.make_vec(task, NUMBER, device=device, observation=names, **settings)
    assert envs.num_envs == NUMBER
    assert envs.observation_space == batch_space(envs.single_observation_space, NUMBER)
    assert envs.action_space == batch_space(envs.single_action_space, NUMBER)
    assert envs.metadata["autoreset_mode"].value == "NextStep"
    first, infos = envs.reset(seed=[3, 4])
    again, _ = envs.reset(seed=[3, 4])
    assert first in envs.observation_space
    _check_infos(infos)
    for name, array in first.items():
        np.testing.assert_array_equal(array, again[name])
    envs.action_space.seed(0)
    for step in range(1, 6):
        kept = {name: array.copy() for name, array in first.items()}
        actions = envs.action_space.sample()
        asked = actions.copy()
        observations, rewards, terminated, truncated, infos = envs.step(actions)
        assert observations in envs.observation_space
        np.testing.assert_array_equal(actions, asked)
        for name, array in kept.items():  # Returned arrays do not change.
            np.testing.assert_array_equal(first[name], array)
        assert rewards.shape == (NUMBER,) and rewards.dtype == np.float64
        for ends in (terminated, truncated):
            assert ends.shape == (NUMBER,) and ends.dtype == bool
        assert truncated.all() == (step == HORIZON) and not terminated.any()
        if step == HORIZON + 1:  # A reset, whatever the actions.
            assert not rewards.any()
        _check_infos(infos)
        first = observations
    envs.close()
    envs.close()  # Once more does no harm.


@pytest.mark.parametrize("device", ["host", "cpu"])
def test_infos_say_who_is_successful(device):
    """By the name that Stable-Baselines3 reads; variation 50 of the rope starts nearly straight."""
    envs = softgym_mj.make_vec("straighten_rope", NUMBER, device=device, num_workers=1, split="all")
    _, infos = envs.reset(options={"variation": [49, 50]})
    assert infos["is_success"].tolist() == infos["success"].tolist() == [False, True]
    envs.close()
