"""Tasks keep the conventions of dm_control's composer, or say where they do not."""

import numpy as np
import pytest
from dm_control import composer
from dm_control.viewer.runtime import Runtime

import softgym_mj
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import LifecycleError
from softgym_mj.policies.factory import make_policy


@pytest.mark.parametrize("task", ["straighten_rope", "pour_water"])
def test_composers_own_environment_runs_our_tasks(task):
    """An expert's actions have the same rewards there, in whatever variation it chooses."""
    ours = softgym_mj.load(task, split="all", fidelity="fast")
    theirs = composer.Environment(
        softgym_mj.TASKS[task].build(fidelity="fast"),
        random_state=3,
        strip_singleton_obs_buffer_dim=True,
    )
    variations = set()
    for _ in range(2):
        other = theirs.reset()
        variations.add(theirs.task.variation)
        timestep = ours.reset(theirs.task.variation)
        policy = make_policy("scripted", ours, 0)
        for _ in range(10):
            action = policy(timestep)
            timestep, other = ours.step(action), theirs.step(action)
            assert timestep.reward == other.reward
            np.testing.assert_array_equal(
                timestep.observation["reduced"], other.observation["reduced"]
            )
    assert len(variations) == 2


def test_dm_controls_viewer_runs_our_tasks():
    env = composer.Environment(softgym_mj.TASKS["straighten_rope"].build(), random_state=0)
    spec = env.action_spec()
    runtime = Runtime(env, lambda timestep: np.full(spec.shape, 0.1))
    for _ in range(20):
        runtime.tick(0.02, paused=False)
    assert runtime.get_time() == pytest.approx(0.4, abs=0.1)


def test_actions_that_take_as_long_as_they_need_are_refused_there():
    task = softgym_mj.TASKS["straighten_rope"].build(actor="pick_and_place")
    env = composer.Environment(task, random_state=0)
    env.reset()
    with pytest.raises(
        LifecycleError, match=r"run the task in softgym_mj.envs.environment.Environ"
    ):
        env.step(np.zeros(8))


@pytest.mark.parametrize("where", ["task", "entity"])
def test_edits_of_the_model_at_the_start_of_an_episode_count(where):
    """Gravity is the number of the episode, as the model says it before it is compiled."""
    task = softgym_mj.TASKS["straighten_rope"].build()
    part = task if where == "task" else task.root_entity
    started = []

    def edit(self, random_state):
        started.append(random_state)
        task.root_entity.mjcf_model.option.gravity = [0.0, 0.0, -len(started)]

    part.__class__ = type("Edited", (type(part),), {"initialize_episode_mjcf": edit})
    env = Environment(task, name="edited", horizon=5)
    for episode in (1, 2, 3):
        env.reset(800)
        assert env.physics.model.opt.gravity[2] == -episode
        env.step(np.zeros(8))
