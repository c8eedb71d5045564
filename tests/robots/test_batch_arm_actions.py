"""Action spaces of arms in batches against those of environments, without joints."""

import jax
import numpy as np
import pytest

import softgym_mj
from softgym_mj.robots.arm.pose_action import MAX_TILT
from softgym_mj.robots.arm_batch import rotations
from softgym_mj.robots.arm_batch.action_spaces import ACTION_SPACES
from softgym_mj.robots.arm_batch.inverse_kinematics import kinematics_of
from softgym_mj.robots.arm_batch.state import packed, read_state, unpacked


@pytest.mark.parametrize("action", ACTION_SPACES)
def test_commands_advance_as_in_environments(action):
    """The reference is the environment's; commands reach limits of tilt, joints and tracking."""
    env = softgym_mj.load("straighten_rope", actor="franka", action=action)
    env.reset(800)
    arms, random = env.task.actor, np.random.default_rng(0)
    own, number = arms._filtered_command, arms.num_grippers
    with jax.enable_x64(True):
        space = ACTION_SPACES[action](arms.arm, kinematics_of(arms.arm, arms.mounts, 0.0))
        state = packed(read_state(arms))
        advance = jax.jit(space.advance)
        found = jax.jit(lambda state: (space.commanded(state), space.remembered(state)))
        drift = random.uniform(-0.5, 0.5, arms.action_size)
        drift[3] = 1.0  # A tilt, or a joint.
        tilts = []
        for k in range(150):
            entries = np.clip(drift + random.uniform(-1.0, 1.0, arms.action_size), -1.0, 1.0)
            own.command(entries)
            own.advance()
            state = advance(state, entries.reshape(number, -1)[:, :-1])
            states, arrays = own.get_state(), unpacked(state)
            names = "commanded", "points", "step"
            pairs = [*zip((arrays[name] for name in names), states["filter"], strict=True)]
            if action == "pose":
                turned = (arrays[f"turn_{name}"] for name in names)
                pairs += [*zip(turned, states["turns"], strict=True)]
                pairs.append((arrays["oriented"], states["oriented"]))
                tilts.append(rotations.matrices(own.orientations)[:, 2, 2])
            pairs += zip(found(state), (own.commanded, own.remembered()), strict=True)
            for array, expected in pairs:
                np.testing.assert_allclose(array, expected, atol=1e-9)
            if k % 2 == 1:
                own.follow(1)
                controller = arms.controller
                reference = controller.configuration.reshape(number, -1)
                state = state._replace(reference=reference, reference_points=controller.points())
    if action == "pose":
        assert -np.max(tilts) == pytest.approx(np.cos(MAX_TILT), abs=1e-6)
