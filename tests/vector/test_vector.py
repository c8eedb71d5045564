"""Vector environments: against single ones in a loop, by all ways to make them; processes."""

import multiprocessing

import gymnasium
import numpy as np
import pytest

import softgym_mj
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError, UnavailableError
from softgym_mj.rendering.offscreen import CameraView
from tests.vector.same import same

ROPE = "softgym_mj/StraightenRope-v0"
HORIZON, SEED, NUM_ENVS = 3, 7, 2


def make(**kwargs):
    return gymnasium.make_vec(ROPE, num_envs=NUM_ENVS, horizon=HORIZON, **kwargs)


def actions_of(envs, count):
    """Random actions (count, NUM_ENVS, n)."""
    size = (count, *envs.action_space.shape)
    return np.random.default_rng(0).uniform(-1, 1, size).astype(np.float32)


def test_two_names_make_the_same():
    """A mode can be Gymnasium's own, a task its record."""
    mode = gymnasium.vector.AutoresetMode.SAME_STEP
    record = softgym_mj.TASKS["straighten_rope"]
    one = make(autoreset_mode="SameStep")
    other = softgym_mj.make_vec(record, NUM_ENVS, horizon=HORIZON, autoreset_mode=mode)
    assert one.metadata == other.metadata and one.metadata["autoreset_mode"] is mode
    assert same(one.reset(seed=SEED), other.reset(seed=SEED))
    for actions in actions_of(one, HORIZON + 1):
        assert same(one.step(actions), other.step(actions))
    one.close(), other.close()


def test_images_come_through_shared_memory():
    """Images equal those of a single environment, also after this process has rendered."""
    kwargs = {"observation": ["rgb", "reduced"], "image_size": (48, 64)}
    oracle = [SoftGymEnv("straighten_rope", **kwargs) for _ in range(NUM_ENVS)]
    # Renders here: forked processes could not.
    starts = [env.reset(seed=SEED + i) for i, env in enumerate(oracle)]
    envs = make(render_mode="rgb_array", render_size=(32, 32), **kwargs)
    assert envs.observation_space["rgb"].shape == (NUM_ENVS, 48, 64, 3)
    observations, _ = envs.reset(seed=SEED)
    (actions,) = actions_of(envs, 1)
    for expected in (
        [observation for observation, _ in starts],
        [env.step(action)[0] for env, action in zip(oracle, actions, strict=True)],
    ):
        for name in ("rgb", "reduced"):
            assert np.array_equal(observations[name], [single[name] for single in expected])
        observations, *_ = envs.step(actions)
    assert [image.shape for image in envs.render()] == [(32, 32, 3)] * NUM_ENVS
    envs.close()


def _render_in_fork(queue):
    try:
        env = SoftGymEnv("straighten_rope", observation="rgb")
        queue.put(env.reset(seed=0)[0].shape)
    except UnavailableError as error:
        queue.put(str(error))


def _fork_twice(queue):
    """In a fresh process: makes an environment with images, forks, renders, and forks again."""
    env = SoftGymEnv("straighten_rope", observation="rgb")
    for rendered in (False, True):
        if rendered:
            CameraView("task", 16, 16).rgb(env.dm_env.physics)
        child = multiprocessing.get_context("fork").Process(target=_render_in_fork, args=(queue,))
        child.start()
        child.join()


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="this system cannot fork"
)
def test_a_fork_renders_or_says_why_not():
    spawn = multiprocessing.get_context("spawn")
    queue = spawn.Queue()
    parent = spawn.Process(target=_fork_twice, args=(queue,))
    parent.start()
    assert queue.get(timeout=120) == (128, 128, 3)
    answer = queue.get(timeout=120)  # After the parent has rendered.
    parent.join()
    assert "forked" in answer and '"forkserver"' in answer


def test_attributes_are_those_of_the_environments():
    """Whichever of two workers has them."""
    envs = gymnasium.make_vec(ROPE, num_envs=3, num_workers=2, horizon=2)
    assert envs.unwrapped.backend.num_workers == 2
    envs.reset(seed=SEED)
    assert envs.get_attr("horizon") == (2,) * 3
    envs.set_attr("mark", list("abc"))
    assert envs.call("get_wrapper_attr", "mark") == tuple("abc")
    with pytest.raises(AttributeError, match="horizon"):  # Fixed when they are made.
        envs.set_attr("horizon", 3)
    with pytest.raises(InvalidArgumentError, match="make_vec takes clip_actions"):
        envs.set_attr("clip_actions", False)
    envs.close()


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("num_envs", 0),
        ("device", "gpu"),
        ("split", "test"),
        ("autoreset_mode", "sometimes"),
        ("context", "thread"),
        ("num_workers", 0),
        ("num_workers", 3),
        ("observation", "smell"),
    ],
)
def test_bad_arguments(argument, value):
    with pytest.raises(InvalidArgumentError, match=f"{argument}={value!r}"):
        gymnasium.make_vec(ROPE, **{"num_envs": 2, argument: value})
