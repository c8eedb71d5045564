"""Tasks keep the conventions of dm_control's composer, or say where they do not."""

import numpy as np
import pytest
from dm_control import composer

import softgym_mj
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import UndrivenError


def test_another_environment_says_that_it_does_not_act():
    task = softgym_mj.TASKS["straighten_rope"].build()
    env = composer.Environment(task, random_state=0)
    env.reset()
    with pytest.raises(UndrivenError, match=r"run it in softgym_mj.envs.environment.Environment"):
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
