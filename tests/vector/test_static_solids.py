"""Cloth that pickers lay over a fixed bar, in a batch: its bits are those of the environment."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.exceptions import InvalidArgumentError
from tests.vector.experts import check_rows, expert_episode

SETTINGS = {"observation": "full", "split": "all", "fidelity": "fast", "horizon": 60}
VARIATIONS = [803, 811]
FROM = 45  # Env step after which the towel hangs.


@pytest.fixture(scope="module")
def episodes():
    return [expert_episode("hang_cloth", variation, **SETTINGS) for variation in VARIATIONS]


def test_rows_are_environments_with_a_bar_each(episodes):
    assert check_rows("hang_cloth", VARIATIONS, episodes, **SETTINGS).min() > 0.7


def test_a_snapshot_of_a_hanging_towel_continues_anywhere(episodes):
    (env, actions, played), _ = episodes
    envs = softgym_mj.make_vec("hang_cloth", 2, device="host", **SETTINGS)
    envs.reset(seed=0, options={"variation": VARIATIONS[0]})
    for action in actions[:FROM]:
        envs.step(np.stack([action, action]))
    snapshot = envs.get_state()[1]
    env.reset(options={"variation": VARIATIONS[1]})
    env.set_state(snapshot)
    for action, (observation, _) in zip(actions[FROM:], played[FROM + 1 :], strict=True):
        np.testing.assert_array_equal(env.step(action)[0], observation)
    envs.close()


@pytest.mark.long  # JAX compiles for some seconds.
@pytest.mark.parametrize("arms", [1, 2])
def test_hands_meet_the_bar_as_in_environments(arms):
    pytest.importorskip("jax", reason="needs the extra gpu-arms")
    settings = {**SETTINGS, "observation": "proprioception", "actor": "franka", "arms": arms}
    envs = softgym_mj.make_vec("hang_cloth", 2, device="host", **settings)
    env = SoftGymEnv("hang_cloth", **settings)
    envs.reset(seed=0, options={"variation": VARIATIONS})
    env.reset(options={"variation": VARIATIONS[1]})
    actor, found, behind = env.dm_env.task.actor, [], []
    for k in range(12):
        # The hands press on the bar, slide along it and rise.
        action = np.tile([0.4, 0.1, -0.5 if k < 3 else 0.6, -1.0], arms).astype(np.float32)
        sensed, _, *_, infos = envs.step(np.stack([action] * 2))
        expected, *_ = env.step(action)
        found.append(np.abs(sensed[1] - expected)[: 3 * arms].max())
        behind.append(np.abs(actor.positions() - actor.commanded_positions()).max())
    assert max(behind) > 0.08  # [m] The bar stops them.
    assert max(found) < 1e-5  # [m] Tool points while they touch.
    assert infos["physics_warnings"][1] == 0
    envs.close()


def test_arms_are_refused_among_unknown_solids(monkeypatch):
    pytest.importorskip("jax", reason="needs the extra gpu-arms")
    monkeypatch.setattr("softgym_mj.vector.batch.arms.KNOWN", ())
    with pytest.raises(InvalidArgumentError, match=r"fixed solids.*peg_0"):
        softgym_mj.make_vec("route_cable", 2, device="host", actor="franka")


def test_pickers_pass_through_the_bar_and_its_posts():
    envs = softgym_mj.make_vec("hang_cloth", 1, device="host", **SETTINGS)
    env = SoftGymEnv("hang_cloth", **SETTINGS)
    envs.reset(seed=0, options={"variation": 803})
    env.reset(options={"variation": 803})
    action = np.array([0.5, -0.6, 0.0, 0.0, 0.5, 0.6, 0.0, 0.0], np.float32)
    reached = []
    for k in range(12):
        observations, *_ = envs.step(action[None])
        observation, *_ = env.step(action)
        np.testing.assert_array_equal(observations[0], observation)
        assert env.dm_env.physics.data.ncon == 0
        reached.append(env.dm_env.task.actor.positions())
        action[[0, 4]] = 0.5 if k < 2 else -0.2
    posts = np.array([[0.1, -0.36], [0.1, 0.36]])
    away = np.linalg.norm(np.array(reached)[..., :2] - posts, axis=-1)
    assert away.min() < env.dm_env.task.actor.radius
    envs.close()
