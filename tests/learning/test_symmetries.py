"""Symmetries of tasks: their oracles are the tasks' own measures, and simulations."""

import dataclasses

import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.learning.registry import find_method
from softgym_mj.learning.settings import TrainingSettings
from softgym_mj.learning.symmetries import symmetries
from softgym_mj.learning.training import Training
from softgym_mj.tasks import anywhere, mirrored
from softgym_mj.tasks.shared.observations import key_points, reduced
from softgym_mj.tasks.shared.state import State
from tests.custom_tasks import defined_with

NUMBERS = {
    "straighten_rope": 32, "rope_configuration": 32, "spread_cloth": 64, "fold_cloth": 32,
    "fold_crumpled_cloth": 4, "drop_cloth": 4, "drop_fold_cloth": 4,
}  # fmt: skip
STILL = ("fold_crumpled_cloth", "drop_cloth", "drop_fold_cloth")  # Their goals have a place.


def _env(task):
    env = softgym_mj.load(task, split="all", observation="reduced")
    env.reset(807)
    spec = env.action_spec()
    for action in np.random.default_rng(0).uniform(-1.0, 1.0, (3, *spec.shape)):
        env.step(action)
    return env


def _ordered(env, order):
    """Numbers (n,) of the vertices in another order."""
    (thing,) = env.task.scene.materials.values()
    if order in ("same", "reversed"):
        numbers = np.arange(thing.num_points)
        return numbers[::-1] if order == "reversed" else numbers
    grid = thing.arrays["grid"]
    flipped = grid[::-1] if order in ("rows", "both") else grid
    flipped = flipped[:, ::-1] if order in ("columns", "both") else flipped
    result = np.empty(thing.num_points, int)
    result[grid.ravel()] = flipped.ravel()
    return result


def _moved(env, symmetry):
    """The state and the episode as they are under a symmetry."""
    task = env.task
    state, episode = task.scene.state(), task.episode
    (name,) = state.points
    points = state.points[name][_ordered(env, symmetry.order)] @ symmetry.turn.T
    sensed = state.sensed.reshape(-1, 3)[list(symmetry.pickers)] @ symmetry.turn.T
    goal = dict(episode.goal)
    if env.name not in STILL:
        for key, places in goal.items():
            if places.shape[-1] != 3:
                continue
            rows = (
                places[::-1] if symmetry.order in ("rows", "both") and places.ndim == 3 else places
            )
            goal[key] = rows @ symmetry.turn.T
    state = state._replace(points={name: points}, sensed=sensed.ravel())
    return state, dataclasses.replace(episode, goal=goal)


@pytest.mark.parametrize("task", NUMBERS)
def test_measures_and_observations_follow(task):
    env = _env(task)
    result = symmetries(env, "reduced")
    assert len(result) == NUMBERS[task]
    seen = reduced(env.task, env.task.scene.state(), env.task.episode)
    reward = env.task.measure(env.task.scene.state(), env.task.episode).reward
    for symmetry in result:
        state, episode = _moved(env, symmetry)
        expected = reduced(env.task, state, episode)
        np.testing.assert_allclose(symmetry.observation @ seen, expected, atol=1e-12)
        assert env.task.measure(state, episode).reward == pytest.approx(reward, rel=5e-3, abs=1e-9)
    for symmetry, own in zip(symmetries(env, "key_points"), result, strict=True):
        expected = key_points(env.task, *_moved(env, own))
        seen_points = key_points(env.task, env.task.scene.state(), env.task.episode)
        np.testing.assert_allclose(symmetry.observation @ seen_points, expected, atol=1e-12)
    np.testing.assert_array_equal(result[0].observation, np.eye(len(seen)))
    np.testing.assert_array_equal(result[0].action, np.eye(len(result[0].action)))


def test_what_pickers_remember_follows_them():
    env = softgym_mj.load("drop_cloth", split="all", observation="markov", num_pickers=2)
    alone = symmetries(_env("drop_cloth"), "reduced")
    remembered = env.reset(807).observation["markov"][18:]
    assert remembered[::4].tolist() == [1.0, 1.0]  # Two corners are held from the start.
    seen = np.concatenate([np.arange(18.0), [1.0, 0.1, 0.2, 0.3, 0.0, 0.4, 0.5, 0.6]])
    for symmetry, own in zip(symmetries(env, "markov"), alone, strict=True):
        result = symmetry.observation @ seen
        np.testing.assert_array_equal(result[:18], own.observation @ seen[:18])
        held, places = seen[18::4], np.array([seen[19:22], seen[23:26]]) @ symmetry.turn.T
        for k, picker in enumerate(symmetry.pickers):
            np.testing.assert_array_equal(result[18 + 4 * k], held[picker])
            np.testing.assert_allclose(result[19 + 4 * k :][:3], places[picker], atol=1e-15)


@pytest.mark.parametrize("task", ["straighten_rope", "fold_cloth"])
def test_dynamics_follow(task):
    env = _env(task)
    result = symmetries(env, "reduced")
    (thing,) = env.task.scene.materials.values()
    snapshot, workspace = env.get_state(), env.task.workspace
    action = np.random.default_rng(1).uniform(-1.0, 1.0, env.action_spec().shape)
    action[3::4] = -1.0  # Let go: who takes what depends on the order of vertices.
    env.step(action)
    expected = env.task.observe("reduced")
    for symmetry in result[:: len(result) // 8]:
        env.set_state(snapshot)
        state, _ = _moved(env, symmetry)
        velocities = thing.velocities()[_ordered(env, symmetry.order)] @ symmetry.turn.T
        (points,) = state.points.values()
        env.task.actor.place(state.sensed.reshape(-1, 3), workspace)
        thing.set_points(points, velocities)
        env.step(symmetry.action @ action)
        seen = env.task.observe("reduced")
        np.testing.assert_allclose(seen, symmetry.observation @ expected, atol=2e-3)


@pytest.mark.parametrize("task", ["straighten_rope", "fold_cloth"])
def test_arms_follow_a_half_turn(task):
    env = softgym_mj.load(task, split="all", actor="franka")
    env.reset(807)
    result = symmetries(env, "markov")
    assert [each.pickers for each in result] == [(0, 1), (0, 1), (1, 0), (1, 0)]
    actor, workspace = env.task.actor, env.task.workspace
    (thing,) = env.task.scene.materials.values()
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (6, *env.action_spec().shape))
    actions[:, 2::4] = -1.0  # Hands go down.

    def played(symmetry, grip):
        actions[:, 3::4] = grip
        env.reset(807)
        points = thing.points()[_ordered(env, symmetry.order)] @ symmetry.turn.T
        actor.place(actor.positions()[list(symmetry.pickers)] @ symmetry.turn.T, workspace)
        thing.set_points(points)
        for action in actions:
            env.step(symmetry.action @ action)
        return env.task.observe("markov")

    # With another order of vertices, pulled points are solved in another order.
    for grip, own in ((-1.0, result), (1.0, result[::2])):
        expected = played(result[0], grip)
        assert (actor.held.max() >= 0) == (grip > 0.0)
        for symmetry in own:
            seen = played(symmetry, grip)
            np.testing.assert_allclose(seen, symmetry.observation @ expected, atol=1e-4)


def test_symmetries_make_a_group():
    result = symmetries(_env("straighten_rope"), "reduced")
    matrices = {np.round(s.observation).astype(int).tobytes() for s in result}
    assert len(matrices) == len(result)
    for a in result[::5]:
        for b in result[::3]:
            product = np.round(a.observation @ b.observation).astype(int)
            assert product.tobytes() in matrices


def test_what_has_none_is_refused():
    env = softgym_mj.load("pour_water", split="all", fidelity="fast")
    env.reset(3)
    with pytest.raises(InvalidArgumentError, match="task='pour_water'"):
        symmetries(env, "reduced")
    for own in ({"actor": "pick_and_place"}, {"actor": "franka", "action": "joints"}):
        env = softgym_mj.load("straighten_rope", split="all", **own)
        env.reset(3)
        with pytest.raises(InvalidArgumentError, match=f"actor='{own['actor']}'"):
            symmetries(env, "reduced")


def test_the_custom_task_of_the_docs_is_the_same_in_all_its_forms():
    """Its measure is invariant, and tensors of many environments give what one of NumPy does."""
    task = defined_with("GatherRope")["GatherRope"]()
    env = Environment(task, name="gather_rope", horizon=5, split=[3])
    env.reset(3)
    for action in np.random.default_rng(0).uniform(-1.0, 1.0, (3, 8)):
        env.step(action)
    result = symmetries(env, "reduced")
    assert len(result) == 32
    seen = env.task.observe("reduced")
    for symmetry in result:
        state, episode = _moved(env, symmetry)
        measured = env.task.measure(state, episode).performance
        assert measured == pytest.approx(env.task.last_evaluation.performance, abs=1e-12)
        np.testing.assert_allclose(
            reduced(env.task, state, episode), symmetry.observation @ seen, atol=1e-12
        )
    points = env.task.points()
    many = State({"rope": torch.tensor(np.stack([points, 2.0 * points]))}, {}, {}, None, None)
    performance = env.task.measure(many, env.task.episode).performance
    one = env.task.last_evaluation.performance
    np.testing.assert_allclose(performance, [one, 2.0 * one], rtol=1e-12)


def test_a_custom_task_is_trained_with_its_symmetries(tmp_path, register):
    register("gather_rope", defined_with("GatherRope")["GatherRope"])
    training = TrainingSettings(
        "gather_rope", env_steps=16, num_envs=2, part=16, episodes=1, final_episodes=1,
        episode_steps=4,
    )  # fmt: skip
    method = find_method(
        "sac", hidden=(8,), random_steps=4, updates=2, batch=4, replay=16, symmetric=True
    )
    run = Training(training, method, [0], tmp_path, "host")
    run.run()
    assert {row["replay"] for row in run.rows} == {"symmetric"} and run.learner.updates > 0


def test_orders_that_are_none_are_refused():
    for make in (anywhere, mirrored):
        with pytest.raises(InvalidArgumentError, match="order='upwards'"):
            make("upwards")
