"""Vector environments: against single ones in a loop, by all ways to make them; processes."""

import multiprocessing

import gymnasium
import numpy as np
import pytest

import softgym_mj
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import (
    InvalidArgumentError,
    LifecycleError,
    SimulationError,
    UnavailableError,
)
from softgym_mj.rendering.offscreen import CameraView
from tests.vector.same import same

ROPE = "softgym_mj/StraightenRope-v0"
HORIZON, SEED, NUM_ENVS = 3, 7, 2


def make(**kwargs):
    return gymnasium.make_vec(ROPE, num_envs=NUM_ENVS, horizon=HORIZON, **kwargs)


def singles(**kwargs):
    """The environments that `make` has, one by one, reset as it resets them."""
    envs = [SoftGymEnv("straighten_rope", horizon=HORIZON, **kwargs) for _ in range(NUM_ENVS)]
    return envs, [env.reset(seed=SEED + i) for i, env in enumerate(envs)]


def actions_of(envs, count, seed=0):
    """Random actions (count, NUM_ENVS, n)."""
    size = (count, *envs.action_space.shape)
    return np.random.default_rng(seed).uniform(-1, 1, size).astype(np.float32)


def same_info(batch, i, single):
    """Whether entry i of a vector info is the info of a single environment."""
    return all(batch[key][i] == value and batch[f"_{key}"][i] for key, value in single.items())


def test_nothing_resets_by_itself():
    envs = make(autoreset_mode="Disabled")
    oracle, _ = singles()
    envs.reset(seed=SEED)
    for actions in actions_of(envs, HORIZON):
        *_, truncated, _ = envs.step(actions)
    assert truncated.all()
    only_second = {"reset_mask": np.array([False, True]), "variation": 3}
    observations, _ = envs.reset(options=only_second)
    for step_actions in actions_of(envs, HORIZON):
        last = oracle[0].step(step_actions[0])[0]
    assert np.array_equal(observations[0], last)
    assert np.array_equal(observations[1], oracle[1].reset(options={"variation": 3})[0])
    with pytest.raises(LifecycleError, match=r"environments \[0\] have ended: call reset"):
        envs.step(actions)
    envs.close()


def test_two_names_make_the_same():
    """A mode can be Gymnasium's own, a task its record."""
    mode = gymnasium.vector.AutoresetMode.SAME_STEP
    one, other = (
        make(autoreset_mode="SameStep"),
        softgym_mj.make_vec(
            softgym_mj.TASKS["straighten_rope"], NUM_ENVS, horizon=HORIZON, autoreset_mode=mode
        ),
    )
    assert one.metadata == other.metadata and one.metadata["autoreset_mode"] is mode
    assert same(one.reset(seed=SEED), other.reset(seed=SEED))
    for actions in actions_of(one, HORIZON + 1):
        assert same(one.step(actions), other.step(actions))
    one.close(), other.close()


def test_images_come_through_shared_memory():
    """As they are in a single environment; also after this process has rendered."""
    kwargs = {"observation": ["rgb", "reduced"], "image_size": (48, 64)}
    oracle, starts = singles(**kwargs)  # Renders here: forked processes could not.
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


def _fork(rendered, queue):
    """In a fresh process: makes an environment with images, renders or not, and forks."""
    env = SoftGymEnv("straighten_rope", observation="rgb")
    if rendered:
        CameraView("task", 16, 16).rgb(env.dm_env.physics)
    child = multiprocessing.get_context("fork").Process(target=_render_in_fork, args=(queue,))
    child.start()
    child.join()


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="this system cannot fork"
)
@pytest.mark.parametrize("rendered", [False, True])
def test_a_fork_renders_or_says_why_not(rendered):
    spawn = multiprocessing.get_context("spawn")
    queue = spawn.Queue()
    parent = spawn.Process(target=_fork, args=(rendered, queue))
    parent.start()
    answer = queue.get(timeout=120)
    parent.join()
    if rendered:
        assert "forked" in answer and '"forkserver"' in answer
    else:
        assert answer == (128, 128, 3)


@pytest.mark.parametrize("num_workers", [1, 2, 3])
def test_workers_share_environments(num_workers):
    """Five environments in any number of processes do what they do alone."""
    envs = gymnasium.make_vec(ROPE, num_envs=5, num_workers=num_workers, horizon=2)
    assert envs.unwrapped.backend.num_workers == num_workers
    envs.reset(seed=SEED)
    oracle = [SoftGymEnv("straighten_rope", horizon=2) for _ in range(5)]
    for i, env in enumerate(oracle):
        env.reset(seed=SEED + i)
    for actions in actions_of(envs, 2):
        observations, rewards, _, truncated, infos = envs.step(actions)
        for i, env in enumerate(oracle):
            observation, reward, _, ended, info = env.step(actions[i])
            assert np.array_equal(observations[i], observation) and same_info(infos, i, info)
            assert (rewards[i], truncated[i]) == (reward, ended)
    assert envs.get_attr("horizon") == (2,) * 5
    envs.set_attr("mark", list("abcde"))
    assert envs.call("get_wrapper_attr", "mark") == tuple("abcde")
    envs.close()


def test_infos_that_not_all_have():
    """Only who was reset has an info; the mask says so."""
    envs = make(autoreset_mode="Disabled")
    envs.reset(seed=SEED)
    _, infos = envs.reset(options={"reset_mask": np.array([False, True]), "variation": 3})
    assert infos["variation"].tolist() == [0, 3] and infos["_variation"].tolist() == [False, True]
    envs.close()


def test_a_killed_worker_is_an_error():
    envs = make(num_workers=2)
    envs.reset(seed=SEED)
    (victim, *_) = multiprocessing.active_children()
    victim.kill()
    victim.join()
    with pytest.raises(SimulationError, match="has ended"):
        envs.step(np.zeros(envs.action_space.shape, np.float32))
    envs.close()


@pytest.mark.parametrize("actions", [np.zeros(8), np.zeros((3, 8)), 0.0], ids=np.shape)
def test_too_many_or_too_few_actions(actions):
    envs = make()
    envs.reset(seed=SEED)
    with pytest.raises(InvalidArgumentError, match="each of the 2 environments"):
        envs.step(actions)
    envs.close()


def test_bad_actions_and_options():
    envs = make()
    envs.reset(seed=SEED)
    with pytest.raises(InvalidArgumentError, match="finite"):
        envs.step(np.full(envs.action_space.shape, np.nan, np.float32))
    for options, error, message in (
        ({"variation": 1000}, InvalidArgumentError, "variation=1000 is out of range; valid: "),
        ({"smell": 1}, InvalidArgumentError, "'smell' is unknown; valid choices: 'variation'"),
    ):
        with pytest.raises(error, match=message):
            envs.reset(options=options)
    envs.close()


@pytest.mark.parametrize(
    ("argument", "value", "error"),
    [
        ("num_envs", 0, InvalidArgumentError),
        ("device", "cuda", InvalidArgumentError),
        ("split", "test", InvalidArgumentError),
        ("autoreset_mode", "sometimes", InvalidArgumentError),
        ("context", "thread", InvalidArgumentError),
        ("num_workers", 0, InvalidArgumentError),
        ("num_workers", 3, InvalidArgumentError),
        ("observation", "smell", InvalidArgumentError),
    ],
)
def test_bad_arguments(argument, value, error):
    with pytest.raises(error, match=f"{argument}={value!r}"):
        gymnasium.make_vec(ROPE, **{"num_envs": 2, argument: value})
