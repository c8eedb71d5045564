"""The domain of dm_control's suite: its lists, the arguments of `load`, the suite's wrappers."""

import subprocess
import sys

import numpy as np
import pytest
from dm_control import suite
from dm_control.suite.wrappers import action_noise, action_scale, pixels

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError, UnexpectedArgumentError
from softgym_mj.tasks.straighten_rope import StraightenRope

OURS, PLUS = map(softgym_mj.registry.task_names, softgym_mj.registry.SUITES)


@pytest.mark.parametrize(
    "imports",
    [
        "from dm_control import suite; import softgym_mj",
        "from dm_control.suite import ALL_TASKS; import softgym_mj; from dm_control import suite",
    ],
)
def test_the_lists_have_it_whatever_the_order_of_imports(imports):
    ours = "suite.TASKS_BY_DOMAIN['softgym'], *suite.TASKS_BY_DOMAIN['softgym_plus']"
    code = f"{imports}; print(len(suite.ALL_TASKS), *{ours})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    count, *names = done.stdout.split()
    assert tuple(names) == (*OURS, *PLUS) and int(count) == len(suite.ALL_TASKS) > len(OURS) + 40


def test_all_lists(register):
    """The lists that need no tags; tasks that are registered later are in them, too."""
    for tag in ("easy", "hard"):
        expected = {name for name in OURS if tag in softgym_mj.TASKS[name].tags}
        assert set(suite._DOMAINS["softgym"].SUITE.tagged(tag)) == expected
    assert {*suite._DOMAINS["softgym_plus"].SUITE} == {*PLUS} == {*softgym_mj.TASKS} - {*OURS}
    assert suite._get_tasks(None) == suite.ALL_TASKS
    assert suite._get_tasks("no_reward_visualization") == suite.NO_REWARD_VIZ
    assert suite._get_tasks_by_domain(suite.ALL_TASKS) == suite.TASKS_BY_DOMAIN
    assert set(suite.EXTRA) == {*suite.ALL_TASKS} - {*suite.BENCHMARKING}
    ours = {("softgym", task) for task in OURS} | {("softgym_plus", task) for task in PLUS}
    assert ours <= set(suite.EXTRA) and ours <= set(suite.NO_REWARD_VIZ)
    assert not ours & {*suite.BENCHMARKING, *suite.REWARD_VIZ}
    register("another_rope", StraightenRope)
    assert ("softgym", "another_rope") in suite.ALL_TASKS
    assert suite.TASKS_BY_DOMAIN["softgym"] == (*OURS, "another_rope")


@pytest.mark.parametrize("name", ["nosuch", 3, None])
def test_another_suite_is_refused(name):
    with pytest.raises(InvalidArgumentError, match=r"suite=.*'softgym', 'softgym_plus'"):
        softgym_mj.registry.task_names(name)


MATERIALS = {"fold_cloth": {"fidelity": "fast"}, "straighten_rope": {}, "transport_water": {}}


def load(task, seed=3, **kwargs):
    return suite.load("softgym", task, {"random": seed, **MATERIALS[task], **kwargs})


@pytest.mark.parametrize("task", MATERIALS)
def test_action_noise(task):
    """Drawn from the environment's generator: the same seed, the same episode; snapshots, too."""
    scale = 0.1
    first, same, bare = load(task), load(task), load(task)
    noisy, again = (action_noise.Wrapper(env, scale) for env in (first, same))
    action = np.zeros(bare.action_spec().shape)
    for env in (noisy, again, bare):
        env.reset()
    state = first.get_state()
    expected = action + bare.random_state.normal(scale=scale * np.full(action.shape, 2.0))
    for env in (noisy, again):
        np.testing.assert_array_equal(
            env.step(action).observation["reduced"], bare_step(bare, state, expected)
        )
    first.set_state(state), bare.set_state(state)
    assert first.task.random is first.random_state
    np.testing.assert_array_equal(
        noisy.step(action).observation["reduced"], bare_step(bare, state, expected)
    )


def bare_step(env, state, action):
    """What an action without further noise shows."""
    env.set_state(state)
    return env.step(np.clip(action, -1, 1)).observation["reduced"]


def test_action_noise_before_the_first_reset():
    env = action_noise.Wrapper(load("straighten_rope"))
    assert env.step(np.zeros(8)).first()


@pytest.mark.parametrize("task", MATERIALS)
def test_action_scale(task):
    scaled, bare = action_scale.Wrapper(load(task), minimum=0.0, maximum=10.0), load(task)
    action = np.random.default_rng(0).uniform(-1, 1, bare.action_spec().shape)
    scaled.reset(), bare.reset()
    one, other = scaled.step(5.0 * (action + 1.0)), bare.step(action)
    np.testing.assert_allclose(one.observation["reduced"], other.observation["reduced"], atol=1e-5)
    assert scaled.action_spec().maximum.max() == 10.0


@pytest.mark.parametrize("task", MATERIALS)
def test_pixels(task):
    kwargs = {"height": 32, "width": 48, "camera_id": "task"}
    env = pixels.Wrapper(load(task), pixels_only=False, render_kwargs=kwargs)
    image = env.reset().observation["pixels"]
    env.observation_spec()["pixels"].validate(image)
    assert image.shape == (32, 48, 3) and image.std() > 1.0
    assert "reduced" in env.observation_spec()


def test_arguments_of_load():
    env = suite.load(
        "softgym", "straighten_rope", {"random": 3, "split": [801]}, {"horizon": 2}, False
    )
    assert env.horizon == 2 and env.reset().first() and env.current_variation == 801
    for task_kwargs, environment_kwargs, error in (
        ({"horizon": 3}, {"horizon": 2}, InvalidArgumentError),
        ({"random": 1}, {"random_state": 2}, InvalidArgumentError),
        ({"random": "x"}, None, InvalidArgumentError),
        (None, 5, InvalidArgumentError),
        (None, {"flat_observation": True}, UnexpectedArgumentError),
        ({"time_limit": 3.0}, None, UnexpectedArgumentError),
    ):
        with pytest.raises(error):
            suite.load("softgym", "straighten_rope", task_kwargs, environment_kwargs)
    with pytest.raises(InvalidArgumentError, match=r"visualize_reward=True is .*expected False"):
        suite.load("softgym", "straighten_rope", visualize_reward=True)
