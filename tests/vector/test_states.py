"""States, seeds and variations of vector environments, against single environments."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest

from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError, LifecycleError, SnapshotError
from tests.vector.same import same

ROPE = "softgym_mj/StraightenRope-v0"
HORIZON, SEED, NUM_ENVS = 3, 7, 3


def make(**kwargs):
    return gymnasium.make_vec(ROPE, num_envs=NUM_ENVS, num_workers=2, horizon=HORIZON, **kwargs)


def actions(count, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (count, NUM_ENVS, 8)).astype(np.float32)


@pytest.fixture(name="envs", scope="module")
def _envs():
    """Reset before each use."""
    envs = make()
    yield envs
    envs.close()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_new_one_continues(mode):
    """From any step of an episode through the next: what ended is reset, to the same variation."""
    envs, twin = make(autoreset_mode=mode), make(autoreset_mode=mode)
    for taken in (0, 1, HORIZON):
        last = envs.reset(seed=SEED)
        for action in actions(taken):
            last = envs.step(action)
        states = pickle.loads(pickle.dumps(envs.get_state()))
        observations, infos = twin.set_state(states)
        assert same(observations, last[0])
        assert all(same(infos[key], last[-1][key]) for key in ("variation", "performance"))
        for action in actions(2 * HORIZON + 1, seed=1):
            assert same(envs.step(action), twin.step(action))
    envs.close(), twin.close()


def test_an_ended_one_waits_for_its_reset():
    envs, twin = make(autoreset_mode="Disabled"), make(autoreset_mode="Disabled")
    envs.reset(seed=SEED)
    for action in actions(HORIZON):
        envs.step(action)
    envs.reset(options={"reset_mask": np.array([True, False, True])})
    twin.set_state(envs.get_state())
    with pytest.raises(LifecycleError, match=r"environments \[1\] have ended"):
        twin.step(actions(1)[0])
    only = {"reset_mask": np.array([False, True, False])}
    assert same(twin.reset(options=dict(only)), envs.reset(options=dict(only)))
    assert same(twin.step(actions(1)[0]), envs.step(actions(1)[0]))
    envs.close(), twin.close()


def test_states_of_single_environments(envs):
    """A vector environment continues from them, and returns states that they restore."""
    singles = [SoftGymEnv("straighten_rope") for _ in range(NUM_ENVS)]
    for i, env in enumerate(singles):
        env.reset(seed=i)
        env.step(actions(1)[0, i])
    envs.set_state([env.get_state() for env in singles])
    (act,) = actions(1, seed=1)
    observations, rewards, *_ = envs.step(act)
    for i, env in enumerate(singles):
        observation, reward, *_ = env.step(act[i])
        assert np.array_equal(observations[i], observation) and rewards[i] == reward
        env.set_state(envs.get_state()[i])


def test_bad_states(envs):
    cloth = SoftGymEnv("spread_cloth", fidelity="fast")
    envs.reset(seed=SEED), cloth.reset(seed=SEED)
    states = envs.get_state()
    for bad, message in (
        (states[:2], "all 3 environments, not list of length 2$"),
        (states[0], "all 3 environments, not tuple of length 2$"),
        (None, "all 3 environments, not NoneType None"),
        ([*states[:2], None], "what `get_state` returned, not NoneType None"),
        (
            [cloth.get_state()] * NUM_ENVS,
            "of task 'spread_cloth', the environment of 'straighten_rope'",
        ),
    ):
        with pytest.raises(SnapshotError, match=message):
            envs.set_state(bad)
    with pytest.raises(
        InvalidArgumentError, match=r"seed=\[7, 8, 9\] is not valid.*None with the option 'state'"
    ):
        envs.reset(seed=[7, 8, 9], options={"state": states})


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_no_copies(envs, copied):
    with pytest.raises(LifecycleError, match=r"other.set_state\(envs.get_state\(\)\)"):
        copied(envs)


@pytest.mark.parametrize("given", [list, tuple, np.array])
def test_chosen_variations(envs, given):
    single = SoftGymEnv("straighten_rope")
    observations, infos = envs.reset(seed=SEED, options={"variation": given([812, 813, 5])})
    assert infos["variation"].tolist() == [812, 813, 5]
    for observation, variation in zip(observations, (812, 813, 5), strict=True):
        assert np.array_equal(observation, single.reset(options={"variation": variation})[0])
    mask = np.array([False, True, True])
    envs.reset(options={"variation": given([0, 1, 2]), "reset_mask": mask})
    assert envs.call("get_state")[0][0].task["variation"] == 812
    assert [state[0].task["variation"] for state in envs.get_state()] == [812, 1, 2]
    assert envs.reset(options={"variation": 4})[1]["variation"].tolist() == [4] * NUM_ENVS
    for bad, message in (
        (given([1, 2]), "an index, or one for each of the 3 environments"),
        (given([1, 2, 1000]), r"variation=1000 is not valid: expected a whole number in 0\.\.999"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            envs.reset(options={"variation": bad})


def test_seeds(envs):
    """Whole numbers of numpy are as good as Python's."""
    expected = envs.reset(seed=SEED)
    seeds = np.arange(SEED, SEED + NUM_ENVS)
    for seed in (seeds[0], seeds, seeds.tolist(), tuple(seeds)):
        assert same(envs.reset(seed=seed), expected)
    for bad in (1.5, True, [1, 2], [1, 2, True], [1, 2, "3"], [1, 2, -1], "abc"):
        with pytest.raises(InvalidArgumentError, match="a whole number, 0 or more, or 3 of them"):
            envs.reset(seed=bad)
    with pytest.raises(
        InvalidArgumentError, match="'smell' is unknown; valid choices: 'variation'"
    ):
        envs.reset(options={"smell": 1})


def test_a_bad_action_steps_nobody(envs):
    envs.reset(seed=SEED)
    before = envs.get_state()
    (act,) = actions(1)
    for bad in (np.nan, np.inf, -np.inf):
        act[1, 6] = bad
        advice = "clip the action first, for example with numpy.clip(action, -1, 1)."
        if np.isnan(bad):
            advice = "NaN comes from the policy or its input, and clipping does not remove it."
        with pytest.raises(InvalidArgumentError) as error:
            envs.step(act)
        assert str(error.value) == (
            f"actions[1, 6] = {bad}, of environment 1, must be finite and within [-1, 1]; {advice} "
            "No environment has been stepped."
        )
    for few in (np.zeros(8), act[:2], 0.0):
        with pytest.raises(InvalidArgumentError) as error:
            envs.step(few)
        assert str(error.value) == (
            f"actions.shape={np.shape(few)} is not valid: expected an action for each of the 3 "
            "environments."
        )
    for wrong in (None, "up"):
        with pytest.raises(InvalidArgumentError) as error:
            envs.step(wrong)
        assert str(error.value) == f"actions={wrong!r} is not valid: expected real numbers (3, 8)."
    for wrong in (act[:, :7], act.astype(str), [[0.0] * 8, [0.0] * 8, "up"]):
        with pytest.raises(InvalidArgumentError):
            envs.step(wrong)
    for one, other in zip(before, envs.get_state(), strict=True):
        assert one[0].step_count == other[0].step_count == 0
        assert np.array_equal(one[0].physics, other[0].physics)
    envs.step(np.full((NUM_ENVS, 8), 1 + 5e-7))  # Rounding, not a mistake.
