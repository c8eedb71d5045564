"""Switch entries of actions: half of a switch does the same, half of another entry does not."""

import numpy as np
import pytest

import softgym_mj


@pytest.mark.parametrize(
    ("task", "actor", "action"),
    [
        ("straighten_rope", "picker", None),
        ("straighten_rope", "pick_and_place", None),
        ("spread_cloth", "pixel_pick_and_place", None),
        ("straighten_rope", "franka", None),
        ("straighten_rope", "franka", "pose"),
        ("straighten_rope", "franka", "joints"),
        ("pour_water", None, None),
        ("transport_water", None, None),
        ("transport_water", "franka", None),
    ],
)
def test_the_sign_alone_counts_of_switches(task, actor, action):
    given = {"actor": actor, "action": action}
    settings = {name: value for name, value in given.items() if value is not None}
    env = softgym_mj.load(task, split="all", fidelity="fast", **settings)
    env.reset(0)
    start, size = env.get_state(), env.task.actor.action_size

    def after(action):
        env.set_state(start)
        env.step(action)
        data = env.physics.data  # Cups are mocap bodies.
        return np.concatenate([data.qpos, data.mocap_pos.ravel(), data.mocap_quat.ravel()])

    whole = np.full(size, 0.4)
    alike = [i for i in range(size) if np.array_equal(after(whole), after(_halved(whole, i)))]
    assert alike == list(env.task.actor.actions.switches)


def _halved(action, i):
    halved = action.copy()
    halved[i] *= 0.5
    return halved
