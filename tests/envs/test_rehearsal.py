"""A rehearsal changes nothing, and predicts what then happens."""

import numpy as np
import pytest

import softgym_mj

SIZE = {"image_size": (32, 32)}


def actions(env, seed, number):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (number, env.task.actor.action_size))


def steps(env, rehearses):
    """Everything that can be seen of an episode, with rehearsals between its env steps or not."""
    timestep = env.reset(3)
    seen = []
    for number, action in enumerate(actions(env, 0, 8)):
        if rehearses and number % 3 == 1:
            with env.rehearsal() as goes_on:
                for tried in actions(env, number, 6):
                    goes_on(tried)
                with env.rehearsal() as goes_on_from_there:
                    goes_on_from_there(action)
        timestep = env.step(action)
        seen.append((timestep, env.info(), env.physics.get_state(), env.step_count))
    return seen


@pytest.mark.parametrize(
    ("task", "settings"),
    [
        ("rope_configuration", {}),
        ("fold_crumpled_cloth", {"observation": "rgb", **SIZE}),
        ("drop_fold_cloth", {"actor": "franka", "fidelity": "fast"}),
        ("pour_water", {"fidelity": "fast"}),
    ],
)
def test_a_rehearsal_leaves_nothing(task, settings):
    plain, rehearsed = (
        steps(softgym_mj.load(task, split="all", **settings), rehearses)
        for rehearses in (False, True)
    )
    for (a, info_a, state_a, count_a), (b, info_b, state_b, count_b) in zip(
        plain, rehearsed, strict=True
    ):
        assert a.reward == b.reward and info_a == info_b and count_a == count_b
        np.testing.assert_array_equal(state_a, state_b)
        for name, value in a.observation.items():
            np.testing.assert_array_equal(value, b.observation[name])


def test_what_is_rehearsed_is_what_happens():
    env = softgym_mj.load("straighten_rope", split="all")
    env.reset(4)
    with env.rehearsal() as goes_on:
        assert all(goes_on(action) for action in actions(env, 0, 10))
        expected = env.info()
    for action in actions(env, 0, 10):
        env.step(action)
    assert env.info() == expected


def test_a_rehearsal_ends_with_the_episode_and_after_an_error():
    env = softgym_mj.load("straighten_rope", split="all")
    env.reset(4)
    before = env.info()
    with env.rehearsal() as goes_on:
        still = [goes_on(action) for action in actions(env, 0, env.horizon)]
    assert still == [True] * (env.horizon - 1) + [False]
    with pytest.raises(KeyError), env.rehearsal() as goes_on:
        goes_on(actions(env, 0, 1)[0])
        raise KeyError
    assert env.info() == before and env.step_count == 0
    assert not env.step(actions(env, 0, 1)[0]).last()
