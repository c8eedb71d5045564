"""The largest strain of an episode, in infos."""

import numpy as np

import softgym_mj

NOW, SO_FAR = "max_edge_strain", "episode_max_edge_strain"


def pull(env):
    """Pulls the ends of a rope apart and lets go: `max_edge_strain` after each env step."""
    found = [env.info()[NOW]]
    for closed, steps in ((1.0, 12), (-1.0, 6)):
        for _ in range(steps):
            env.step(np.array([-0.5, 0.0, 0.0, closed, 0.5, 0.0, 0.0, closed]))
            found.append(env.info()[NOW])
    return found


def test_it_is_that_of_all_steps_and_starts_anew():
    env = softgym_mj.load("straighten_rope", split="evaluate")
    env.reset(800)
    start = env.info()
    assert start[SO_FAR] == start[NOW]
    actor, points = env.task.actor, env.task.objects[0].points()
    actor.place(points[[0, -1]], actor._workspace)
    actor.take([0, len(points) - 1])
    found = pull(env)
    info = env.info()
    assert info[SO_FAR] == max(found) > 1.5 * info[NOW]
    twin = softgym_mj.load("straighten_rope", split="evaluate")
    twin.reset(801)
    twin.set_state(env.get_state())
    assert twin.info() == info
    env.reset(800)
    assert env.info() == start


def test_water_alone_has_none():
    env = softgym_mj.load("transport_water", fidelity="fast")
    env.reset(0)
    assert SO_FAR not in env.info()
