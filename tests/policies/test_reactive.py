"""Reactive experts: hand-computed actions, batches against single observations, whole episodes."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies import reactive
from softgym_mj.policies.factory import make_policy
from softgym_mj.policies.reactive.rope import ABOVE, LAID, PUTTING
from tests.policies.reactive_episodes import check_batches, entries, play

HIGH = 0.1  # [m] Height at which free pickers rest.


def seen(rope, goal, pickers, held=(0, 0), offsets=((0.0,) * 3,) * 2):
    """Returns the observation "markov" (74,) of key points, pickers, grips and offsets [m]."""
    grips = np.column_stack([held, offsets])
    return np.concatenate([np.ravel(part) for part in (rope, goal, pickers, grips)])


def straight(y):
    """Returns key points (10, 3) [m] on a line parallel to X, 0.05 m apart."""
    return np.column_stack([0.05 * np.arange(10) - 0.225, np.full(10, y), np.full(10, 0.00625)])


def test_pickers_rest_if_the_rope_is_placed():
    pickers = [[-0.1, 0.2, HIGH], [0.1, 0.2, HIGH]]
    moves, grips = entries(reactive.rope_configuration(seen(straight(0), straight(0), pickers)))
    np.testing.assert_allclose(moves, 0.0, atol=1e-12)
    assert grips.tolist() == [-1.0, -1.0]


def test_a_free_picker_goes_to_the_displaced_end_and_the_other_one_rests():
    rope = straight(0)
    rope[-1, 1] += 0.1  # 0.1 m off: only the last segment is misplaced.
    pickers = [[0.225, 0.5, HIGH], [-0.2, -0.3, HIGH]]
    moves, grips = entries(reactive.rope_configuration(seen(rope, straight(0), pickers)))
    # The end is 0.4 m away along Y, farther than the 0.08 m of an env step.
    np.testing.assert_allclose(moves, [[0.0, -1.0, 0.0], [0.0, 0.0, 0.0]], atol=1e-12)
    assert grips.tolist() == [-1.0, -1.0]


def test_a_picker_over_its_target_descends_and_one_at_its_target_closes():
    rope = straight(0)
    rope[-1, 1] += 0.1
    goal, aside = straight(0), [-0.2, -0.3, HIGH]
    grasp = rope[-1] + [0.0, 0.0, ABOVE]
    over = grasp + [0.0, 0.0, 0.05]
    moves, grips = entries(reactive.rope_configuration(seen(rope, goal, [over, aside])))
    np.testing.assert_allclose(moves[0], [0.0, 0.0, -0.05 / 0.08], atol=1e-12)
    assert grips[0] == -1.0
    moves, grips = entries(reactive.rope_configuration(seen(rope, goal, [grasp, aside])))
    np.testing.assert_allclose(moves[0], 0.0, atol=1e-12)
    assert grips[0] == 1.0
    # After a release under load it has to open first.
    lost = reactive.rope_configuration(seen(rope, goal, [grasp, aside], held=(-1, 0)))
    assert entries(lost)[1][0] == -1.0


def test_a_picker_descends_in_a_funnel():
    rope = straight(0)
    rope[-1, 1] += 0.1
    low, aside = rope[-1, 2] + ABOVE, [-0.2, -0.3, HIGH]
    # 0.03 m beside the end, the funnel is 1.5 (0.03 - 0.01) m high; 0.02 m below it, pickers move
    # half of the way across.
    center = [rope[-1, 0] + 0.03, rope[-1, 1], low + 0.01]
    moves, grips = entries(reactive.rope_configuration(seen(rope, straight(0), [center, aside])))
    np.testing.assert_allclose(moves[0], np.array([-0.015, 0.0, 0.02]) / 0.08, atol=1e-12)
    assert grips[0] == -1.0


def test_a_picker_carries_what_it_holds_slowly_and_releases_it_at_its_place():
    rope = straight(0)
    rope[-1] += [0.0, 0.1, 0.03]
    center, aside = rope[-1] + [0.0, 0.0, 0.034], [-0.2, -0.3, HIGH]
    offsets = [[0.0, 0.0, -0.034], [0.0, 0.0, 0.0]]
    state = seen(rope, straight(0), [center, aside], (1, 0), offsets)
    moves, grips = entries(reactive.rope_configuration(state))
    assert moves[0, 1] == pytest.approx(-PUTTING) and grips[0] == 1.0
    placed = straight(0)
    center = placed[-1] + [0.0, 0.0, LAID - placed[-1, 2]]
    offsets[0][2] = placed[-1, 2] - LAID
    state = seen(placed, straight(0), [center, aside], (1, 0), offsets)
    assert entries(reactive.rope_configuration(state))[1][0] == -1.0


def test_the_nearer_direction_of_the_goal_counts():
    pickers = [[-0.1, 0.2, HIGH], [0.1, 0.2, HIGH]]
    rope, goal = straight(0), straight(0)[::-1]
    action = reactive.rope_configuration(seen(rope, goal, pickers))
    np.testing.assert_array_equal(action, reactive.rope_configuration(seen(rope, rope, pickers)))


def test_batches_have_the_actions_of_single_observations():
    source = np.random.default_rng(0)
    states = 0.1 * source.standard_normal((60, 74))
    states[:, 66::4] = source.integers(-1, 2, (60, 2))
    check_batches(reactive.rope_configuration, states, 1e-12)


def test_it_lays_ropes_in_the_shape_of_letters():
    _, scores, _ = play("rope_configuration", ["markov"], range(700, 710))
    assert np.mean(scores) > 0.7 and np.min(scores) > 0.4


def test_other_tasks_are_refused():
    with pytest.raises(InvalidArgumentError, match="rope_configuration"):
        make_policy("reactive", softgym_mj.load("drop_cloth"))


def test_arms_that_act_by_joints_are_refused():
    env = softgym_mj.load("fold_cloth", actor="franka", action="joints")
    with pytest.raises(InvalidArgumentError, match="displacements of grippers"):
        make_policy("reactive", env)


def test_pick_and_place_is_refused():
    env = softgym_mj.load("fold_cloth", actor="pick_and_place")
    with pytest.raises(InvalidArgumentError, match=r"actor='pick_and_place.*equal lengths"):
        make_policy("reactive", env)


def test_it_acts_by_its_own_observation():
    """Whatever the environment observes, as the function does by what it takes."""
    names = ["full", "markov"]
    actions = []
    for observation in ("reduced", names):
        env = softgym_mj.load("spread_cloth", split="all", observation=observation)
        step, act = env.reset(3), make_policy("reactive", env)
        for _ in range(3):
            actions.append(act(step))
            if observation is names:
                seen = np.concatenate([step.observation[name] for name in names])
                np.testing.assert_allclose(actions[-1], reactive.spread_cloth(seen), atol=1e-6)
            step = env.step(actions[-1])
    np.testing.assert_array_equal(actions[:3], actions[3:])


def test_arms_are_refused_by_experts_that_are_not_made_for_them():
    with pytest.raises(InvalidArgumentError, match="actor='an arm'"):
        reactive.rope_configuration(np.zeros(118))
