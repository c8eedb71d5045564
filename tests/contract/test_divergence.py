"""A simulation that diverges ends its episode, the same way wherever it is simulated."""

import functools

import numpy as np
import pytest
from dm_control.rl.control import PhysicsError
from gymnasium.vector import AutoresetMode

import softgym_mj
from softgym_mj.compat import SOFTGYM_ENVS
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.evaluation.running import play_episode
from softgym_mj.exceptions import LifecycleError, SimulationError
from softgym_mj.policies import episodes
from softgym_mj.recording import episodes as recording
from softgym_mj.registry import find
from softgym_mj.vector.base import VectorEnv
from softgym_mj.vector.processes import ProcessBackend

TASKS = ["spread_cloth", "transport_water"]
SETTINGS = {"observation": "full", "fidelity": "fast"}


def spoil(task):
    """Makes a velocity of the simulation infinite."""
    for flex in task.flexes.flexes:
        flex.slide_velocities[5] = np.inf
    if not task.flexes.flexes:
        task.water.motion[-5] = np.inf


class Spoiled(SoftGymEnv):
    """Diverges in the second env step of variation 4."""

    def step(self, action):
        if self.dm_env.current_variation == 4 and self.dm_env.step_count == 1:
            spoil(self.dm_env.task)
        return super().step(action)


@pytest.mark.parametrize("task", TASKS)
def test_a_dm_control_environment_ends_with_discount_0(task):
    env = softgym_mj.load(task, **SETTINGS)
    first = env.reset(3).observation["full"]
    start = env.info()
    zeros = np.zeros(env.action_spec().shape)
    timestep = env.step(zeros)
    assert timestep.mid() and timestep.discount == 1.0 and not env.diverged
    middle = env.get_state()
    spoil(env.task)
    timestep = env.step(zeros)
    assert timestep.last() and timestep.discount == 0.0 and env.diverged
    # State, observation, reward and info are those of the start of the episode.
    np.testing.assert_array_equal(timestep.observation["full"], first)
    info = env.info()
    terms = sum(value for name, value in start.items() if name.startswith("reward_"))
    assert timestep.reward == pytest.approx(terms)
    counted = {k: n for k, n in info.items() if k == "rejected_moves"}  # In the last env step.
    assert info == {**start, "physics_warnings": 1, "diverged": True, **counted}
    # A snapshot of an episode that runs goes on without a trace of it; so does the next episode.
    env.set_state(middle)
    assert env.info()["physics_warnings"] == 0 and not env.diverged
    assert env.step(zeros).mid()
    env.reset(3)
    assert env.step(zeros).mid() and env.info()["physics_warnings"] == 0


@pytest.mark.parametrize(
    ("task", "mode"),
    [
        ("spread_cloth", AutoresetMode.NEXT_STEP),
        ("transport_water", AutoresetMode.SAME_STEP),
        ("straighten_rope", AutoresetMode.DISABLED),
    ],
)
def test_vectors_of_processes_and_of_rows_say_the_same(task, mode):
    variations, settings = [3, 4, 5], {**SETTINGS, "split": [3, 4, 5], "horizon": 4}
    make = functools.partial(Spoiled, find(task), **settings)
    processes = VectorEnv(ProcessBackend(make, 3, num_workers=1), variations, mode)
    rows = softgym_mj.make_vec(task, 3, device="host", autoreset_mode=mode, **settings)
    for envs in (processes, rows):
        envs.reset(seed=0, options={"variation": variations})
    actions = np.zeros(rows.action_space.shape)
    for step in range(3):
        if step == 1:
            solver = rows.backend._physics._solver
            (solver.qvel if task != "transport_water" else solver.velocities)[1, 1] = np.inf
        ours, theirs = processes.step(actions), rows.step(actions)
        for one, other in zip(ours[:4], theirs[:4], strict=True):
            np.testing.assert_array_equal(one, other)
        infos = [(ours[4], theirs[4])]
        infos += (
            [(ours[4]["final_info"], theirs[4]["final_info"])] if "final_obs" in ours[4] else []
        )
        for one, other in infos:
            for name in ("physics_warnings", "diverged", "performance", "variation"):
                np.testing.assert_array_equal(one[name], other[name], err_msg=name)
        assert ours[2].tolist() == [False, step == 1, False] and not ours[3].any()
        if step == 1 and mode == AutoresetMode.DISABLED:
            with pytest.raises(LifecycleError, match=r"episodes of environments \[1\] have ended"):
                processes.step(actions)
            break
    processes.close()
    rows.close()


def test_a_start_that_diverges_is_an_error():
    env = softgym_mj.load("straighten_rope", fidelity="fast")
    env.reset(3)

    def fail(physics, random_state):
        raise PhysicsError("as MuJoCo's warnings do")

    env.add_extra_hook("initialize_episode", fail)
    with pytest.raises(SimulationError, match="start of variation 7 of straighten_rope diverges"):
        env.reset(7)
    with pytest.raises(LifecycleError, match="no episode has started"):
        env.get_state()
    with pytest.raises(SimulationError, match="start of variation"):  # As after an episode.
        env.step(np.zeros(8))


def test_no_episode_runs_in_gymnasium_after_a_start_that_diverges():
    env = SoftGymEnv("straighten_rope", **SETTINGS)
    env.reset(seed=0)

    def fail(physics, random_state):
        if env.dm_env.task.variation == 7:
            raise PhysicsError("as MuJoCo's warnings do")

    env.dm_env.add_extra_hook("initialize_episode", fail)
    with pytest.raises(SimulationError, match="start of variation 7"):
        env.reset(options={"variation": 7})
    with pytest.raises(LifecycleError, match="no episode is running"):
        env.step(np.zeros(8))
    env.reset(options={"variation": 8})
    env.step(np.zeros(8))


def test_an_episode_continues_if_the_start_of_a_snapshot_diverges():
    """The oracle is an environment that restores nothing."""
    env, oracle, other = (softgym_mj.load("straighten_rope", **SETTINGS) for _ in range(3))
    other.reset(9)
    snapshot = other.get_state()

    def fail(physics, random_state):
        if env.task.variation == 9:
            raise PhysicsError("as MuJoCo's warnings do")

    env.add_extra_hook("initialize_episode", fail)
    random = np.random.default_rng(0)
    for step in range(4):
        action = random.uniform(-1.0, 1.0, env.action_spec().shape)
        timesteps = [each.step(action) if step else each.reset(7) for each in (env, oracle)]
        one, expected = (timestep.observation["full"] for timestep in timesteps)
        np.testing.assert_array_equal(one, expected)
        assert env.task.variation == 7 and env.info() == oracle.info()
        with pytest.raises(SimulationError, match="start of variation 9"):
            env.set_state(snapshot)


class Breaks:
    """A policy that has the third env step diverge; zero actions."""

    def __init__(self, env):
        self.env, self.finished = env, False

    def __call__(self, timestep):
        if self.env.step_count == 2:
            spoil(self.env.task)
        return np.zeros(self.env.action_spec().shape)


def test_an_episode_that_diverges_is_neither_played_nor_scored_nor_recorded():
    env = softgym_mj.load("straighten_rope", fidelity="fast")
    steps = env.play(Breaks(env), 7)
    assert [next(steps).step_type for _ in range(3)] == [0, 1, 1]
    for play in (
        lambda: next(steps),
        lambda: episodes.play(env, Breaks(env), 7, camera=None),
        lambda: play_episode(
            find("straighten_rope"), '{"fidelity": "fast"}', f"{__name__}:Breaks", False, 7, 0
        ),
    ):
        with pytest.raises(SimulationError, match="variation 7 of straighten_rope has diverged"):
            play()
    recorded = SoftGymEnv("straighten_rope", fidelity="fast")
    with pytest.raises(SimulationError, match="variation 7 has diverged: it cannot be recorded"):
        recording.play(recorded, Breaks(recorded.dm_env), 7)


def test_play_yields_an_episode():
    """The oracle is the plain loop."""
    env, other = (softgym_mj.load("straighten_rope", fidelity="fast", horizon=4) for _ in range(2))
    random = np.random.default_rng(0)
    actions = [random.uniform(-1.0, 1.0, env.action_spec().shape) for _ in range(4)]
    played = list(env.play(lambda timestep: actions[env.step_count], 7))
    expected = [other.reset(7), *(other.step(action) for action in actions)]
    for one, another in zip(played, expected, strict=True):
        assert one[:3] == another[:3]
        np.testing.assert_array_equal(one.observation["reduced"], another.observation["reduced"])


def test_an_environment_of_softgym_is_done():
    env = SOFTGYM_ENVS["PassWater"](observation_mode="key_point", action_mode="direct")
    env.reset()
    env.dm_env.task.water.motion[5] = np.nan
    *_, done, info = env.step(env.action_space.sample())
    assert done and info["diverged"]
    with pytest.raises(LifecycleError, match=r"diverged: call reset\(\)"):
        env.step(env.action_space.sample())
