"""Pickers that go all the way: targets, numbers of sim steps, pixels."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError
from tests.robots.test_wrist import seen_at


def make(task="spread_cloth", actor="pick_and_place", **kwargs):
    if "cloth" in task:
        kwargs = {"fidelity": "fast", **kwargs}
    return softgym_mj.load(task, **{"split": "evaluate", "actor": actor, **kwargs})


def to(env, targets, grips):
    """The action that takes the pickers to targets (2, 3) [m]."""
    low, high = env.task.actor.limits
    fraction = (np.asarray(targets) - low) / (high - low)
    return np.column_stack([2 * fraction - 1, np.where(grips, 1.0, -1.0)]).ravel()


def test_pickers_arrive_together_at_a_centimeter_a_sim_step():
    env = make()
    env.reset(800)
    start = env.task.actor.positions()
    targets = start + [[0.303, 0.0, 0.0], [0.0, 0.1, 0.0]]
    before = env.physics.data.time
    env.step(to(env, targets, (False, False)))
    np.testing.assert_allclose(env.task.actor.positions(), targets, atol=1e-9)
    # ceil(0.303 / 0.01) of way and one of rest.
    assert env.info()["sim_steps"] == 32
    assert env.physics.data.time - before == pytest.approx(0.32)
    low, high = env.task.actor.limits  # The ends of the action.
    for corner, value in ((low, -1.0), (high, 1.0)):
        env.step(np.tile([value, value, value, -1.0], 2))
        np.testing.assert_allclose(env.task.actor.positions(), [corner, corner], atol=1e-9)


def test_what_is_taken_is_carried_to_the_target():
    env = make("fold_cloth")
    env.reset(803)
    cloth, actor = env.task.cloth, env.task.actor
    corners = cloth.corners[:2]
    above = cloth.points()[corners] + [0.0, 0.0, 0.055]
    env.step(to(env, above, (False, False)))
    env.step(to(env, above, (True, True)))  # No way: one sim step, in which the pickers close.
    assert env.info()["sim_steps"] == 1
    np.testing.assert_array_equal(actor.held, corners)
    env.step(to(env, above + [0.0, 0.0, 0.2], (True, True)))
    lifted = cloth.points()[corners]
    np.testing.assert_allclose(lifted, above + [0.0, 0.0, 0.145], atol=1e-3)
    env.step(to(env, above + [0.0, 0.0, 0.3], (False, False)))
    assert (actor.held == -1).all()


def test_an_episode_has_twenty_actions_of_one_repeat():
    assert make().horizon == 20
    with pytest.raises(InvalidArgumentError, match=r"action_repeat=8.*1 with actor='pick_and_pl"):
        make(action_repeat=8)


@pytest.mark.parametrize("task", ["spread_cloth", "straighten_rope"])
def test_a_pixel_is_a_point_of_the_floor(task):
    """The point is projected back with the camera's own matrix."""
    env = make(task, actor="pixel_pick_and_place")
    env.reset(800)
    actor = env.task.actor
    for pixel in ([0.0, 0.0], [0.5, -0.3], [-0.7, 0.9]):
        point = actor.point(np.array(pixel))
        assert point[2] == pytest.approx(env.task.objects[0].radius)
        np.testing.assert_allclose(seen_at(env.physics, "task", point), pixel, atol=1e-9)


def test_what_a_pixel_shows_is_taken_and_put_down():
    env = make("straighten_rope", actor="pixel_pick_and_place")
    env.reset(800)
    rope, actor = env.task.rope, env.task.actor
    end = rope.ends[0]
    start = rope.vertex(end)
    pixel = seen_at(env.physics, "task", start)
    env.step(np.array([*pixel, 0.2, -1 / 3, -0.8]))  # By 0.06, -0.1 and up 0.03 m.
    assert (actor.held == -1).all()
    # The rest of the rope carries it on a little.
    np.testing.assert_allclose((rope.vertex(end) - start)[:2], [0.06, -0.1], atol=0.04)
    # Over, down, one to close, there, 20 to rest: the rope has fallen down again.
    assert env.info()["sim_steps"] > 40
    assert rope.vertex(end)[2] < 0.02
