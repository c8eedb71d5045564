"""The rope: length, mass, order, stretch under pull, and the task's metric."""

import mujoco
import numpy as np
import pytest
import scipy.optimize

import softgym_mj
from softgym_mj.entities.rope import FIDELITIES, Rope
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.tasks.shared.starts.settling import SETTLED_SPEED
from softgym_mj.tasks.shared.starts.twisted_rope import TwistedRope
from softgym_mj.variations.indices import NUM_VARIATIONS
from tests.scenes.alone import compiled


@pytest.fixture(name="env", scope="module")
def _env():
    env = softgym_mj.load("straighten_rope", split="evaluate")
    env.reset(800)
    return env


def test_natural_length_and_mass(env):
    rope, model = env.task.rope, env.physics.model.ptr
    points = rope.straight()
    assert rope.num_points == 41
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(0.5)
    masses = [model.body_mass[model.body(f"rope/flex_{i}").id] for i in range(41)]
    assert sum(masses) == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("distance", "normalized"),
    # docs/softgym.md 3.4: d = 0.25 gives 0.5, d = 0.5375 gives 0.925.
    [(0.5, 1.0), (0.25, 0.5), (0.5375, 0.925), (0.0, 0.0), (0.45, 0.9)],
)
def test_reward_table(env, distance, normalized):
    env.reset(800)
    points = env.task.rope.straight()
    points[-1, 0] = points[0, 0] + distance  # Only the ends count.
    env.task.rope.set_points(points)
    env.task.after_step(env.physics, None)
    assert env.task.last_evaluation.performance == pytest.approx(-abs(distance - 0.5))
    assert env.info()["normalized_performance"] == pytest.approx(normalized)
    assert env.info()["success"] == (normalized >= 0.95)
    assert env.info()["end_point_distance"] == pytest.approx(distance)


def test_shipped_states_rest_on_the_floor_at_full_length():
    store = softgym_mj.TASKS["straighten_rope"].build().store
    states = np.array([store.load(i) for i in range(NUM_VARIATIONS)])
    assert states.shape == (1000, 41, 3)
    lengths = np.linalg.norm(np.diff(states, axis=1), axis=2).sum(axis=1)
    np.testing.assert_allclose(lengths, 0.5, atol=0.01)
    assert states[..., 2].min() > 0.0 and states[..., 2].max() < 0.06
    np.testing.assert_allclose(states[..., :2].mean(axis=1), 0.0, atol=1e-6)
    assert len(np.unique(states[:, 0, 0])) == 1000


def test_shipped_states_are_what_the_generator_makes():
    store = softgym_mj.TASKS["straighten_rope"].build().store
    for index in (0, 807):
        made = TwistedRope().generate(index)
        np.testing.assert_allclose(store.load(index), made, atol=1e-6)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_an_episode_starts_at_every_fidelity_with_a_rope_of_full_length(fidelity):
    env = softgym_mj.load("straighten_rope", fidelity=fidelity)
    env.reset(3)
    vertices = env.task.rope.points()
    assert len(vertices) == FIDELITIES[fidelity]
    lengths = np.linalg.norm(np.diff(vertices, axis=0), axis=1)
    assert lengths.sum() == pytest.approx(0.5, abs=0.01)
    assert len(np.unique(vertices[:, 1])) == len(vertices)  # Not the straight rope.


def test_shipped_states_stay_where_they_are(env):
    for index in (3, 500, 999):
        start = env.reset(index)
        del start
        before = env.task.rope.points()
        for _ in range(10):
            env.step(np.zeros(8))
        moved = np.linalg.norm(env.task.rope.points() - before, axis=1)
        assert moved.max() < SETTLED_SPEED * 0.8  # 0.8 s at less than the settled speed.


@pytest.mark.parametrize(
    ("positions", "velocities", "message"),
    [
        (lambda good: good.T, 0.0, r"positions.shape=\(3, 41\) .*\(41, 3\)"),
        (lambda good: good.ravel(), 0.0, r"positions.shape=\(123,\)"),
        (lambda good: "abc", 0.0, r"positions.shape=\(\)"),
        (lambda good: good, np.nan, "velocities=nan .*finite numbers"),
        (lambda good: good, np.zeros(5), r"velocities.shape=\(5,\) .*\(41, 3\) or \(3,\) or \(\)"),
    ],
)
def test_wrong_points_are_refused_and_move_nothing(positions, velocities, message):
    rope = Rope()
    compiled(rope)
    before = rope.points()
    good = rope.straight() + [0.0, 0.0, 0.5]
    with pytest.raises(InvalidArgumentError, match=message):
        rope.set_points(positions(good), velocities)
    np.testing.assert_array_equal(rope.points(), before)
    rope.set_points(good, np.ones((41, 3)))
    np.testing.assert_array_equal(rope.points(), good)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_it_hangs_as_a_catenary_at_every_fidelity(fidelity):
    """Length 2 a sinh(w / 2 a) = 0.5 m for width w = 0.3 m; sag a (cosh(w / 2 a) - 1)."""
    rope = Rope(fidelity)
    physics = compiled(rope)
    first, last = rope.ends
    points = rope.straight() + [0.0, 0.0, 0.5]
    rope.set_points(points)
    rope.hold(first), rope.hold(last)
    ends = {first: points[first].copy(), last: points[last].copy()}
    for step in range(800):
        moved = min(step / 200, 1.0) * 0.1
        for vertex, inwards in ((first, moved), (last, -moved)):
            rope.drive(vertex, ends[vertex] + [inwards, 0.0, 0.0], rope.timestep)
        mujoco.mj_step(physics.model.ptr, physics.data.ptr)
    a = scipy.optimize.brentq(lambda a: 2 * a * np.sinh(0.15 / a) - 0.5, 0.05, 1.0)
    sag = rope.vertex(first)[2] - rope.points()[:, 2].min()
    # Bending stiffness rounds the lowest point: (EI / weight)^(1/3) = 2 cm.
    assert sag == pytest.approx(a * (np.cosh(0.15 / a) - 1), rel=0.04)
    np.testing.assert_allclose(rope.edge_strain(), 0.0, atol=0.02)
