"""The task route_cable: its score of ropes in known places, its routes, and its expert."""

import math

import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities.rope import LENGTH, RADIUS
from softgym_mj.exceptions import InvalidArgumentError, SnapshotError
from softgym_mj.policies.factory import make_policy
from softgym_mj.tasks.route_cable import (
    GAP,
    HEIGHT,
    JAW,
    PEG_RADIUS,
    REACH,
    ROUTES,
    SLACK,
    RouteCable,
    _wave,
    gate_distances,
)
from softgym_mj.variations.indices import SPLITS

# Vertices and straight lines between them leave the wave by less [m]: chords of 12.5 mm.
COARSE = 1e-3


@pytest.fixture(scope="module")
def env():
    env = softgym_mj.load("route_cable", split="evaluate")
    env.reset(800)
    return env


def measure(env, points):
    """Measures the rope with its vertices at points (n, 3) [m]."""
    task = env.task
    return task.measure(task.state()._replace(points={"rope": points}), task.episode)


@pytest.mark.parametrize("routes", ROUTES)
def test_a_rope_on_its_route_passes_all_gates_in_either_direction(routes):
    env = softgym_mj.load("route_cable", split="all", routes=routes)
    for variation in (0, 803):
        env.reset(variation)
        route = env.task.episode.goal["rope"]
        lengths = np.linalg.norm(np.diff(route, axis=0), axis=1)
        assert lengths.sum() == pytest.approx(LENGTH, rel=0.01)
        for points in (route, route[::-1]):
            assert measure(env, points).performance > 1.0 - 5 * COARSE / REACH


def test_distances_from_gates_are_those_computed_by_hand():
    rope = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0]])
    gates = np.array(
        [
            [[0.05, 0.01, 0.0], [0.05, 0.03, 0.0]],  # 1 cm beside the rope.
            [[0.1, -0.01, 0.0], [0.1, 0.01, 0.0]],  # Passed.
            [[0.1, 0.0, 0.02], [0.1, 0.01, 0.02]],  # 2 cm above it.
            [[-0.03, 0.04, 0.0], [-0.03, 0.06, 0.0]],  # 5 cm from its end: 3, 4, 5.
        ]
    )
    expected = np.array([0.01, 0.0, 0.02, 0.05]) - [SLACK, 0.0, SLACK, SLACK]
    np.testing.assert_allclose(gate_distances(rope, gates), expected, atol=1e-12)


def test_a_rope_behind_a_peg_or_beside_a_clip_loses_these_gates(env):
    route, task = env.task.episode.goal["rope"], env.task
    whole = measure(env, route).performance
    gates = task.gates(800)
    for k, gate in enumerate(gates):
        outward = (gate[1] - gate[0]) / np.linalg.norm(gate[1] - gate[0])
        # The rope as a bump to the other side of the peg, or over a jaw of the clip.
        shift = 2 * (PEG_RADIUS + RADIUS) if 0 < k < 4 else GAP + 2 * RADIUS
        near = np.abs(route[:, 0] - gate[0, 0]) < 0.04
        moved = route.copy()
        moved[near, :2] -= shift * outward
        assert measure(env, moved).performance == pytest.approx(whole - 0.2, abs=0.03)


def test_a_held_rope_does_not_pass_gates(env):
    raised = env.task.episode.goal["rope"] + [0.0, 0.0, REACH + 2 * SLACK]
    assert measure(env, raised).performance == 0.0


@pytest.mark.parametrize("routes", ROUTES)
def test_a_rope_starts_away_from_all_gates(routes):
    env = softgym_mj.load("route_cable", split="all", routes=routes)
    for variation in range(790, 820):
        env.reset(variation)
        assert env.info()["normalized_performance"] == 0.0
    for _ in range(5):
        reward = env.step(np.zeros(env.action_spec().shape)).reward
        assert reward == pytest.approx(0.0, abs=1e-6)


def test_the_reward_grows_as_the_rope_comes_nearer(env):
    start, goal = env.task.episode.points["rope"], env.task.episode.goal
    away = gate_distances(start, goal["gates"]).mean()
    assert goal["start"] == away > REACH
    line = start + [0.0, 0.8 * (goal["rope"][:, 1] - start[:, 1]).mean(), 0.0]
    ways = ((start, line), (line, goal["rope"]))  # Carried towards the pegs, then around them.
    found = []
    for first, last in ways:
        for share in np.linspace(0.0, 1.0, 6):
            points = first + share * (last - first)
            measures = measure(env, points)
            performance = measures.performance
            approach = 1.0 - gate_distances(points, goal["gates"]).mean() / away
            expected = performance + (1.0 - performance) * approach / 2.0
            assert measures.reward == pytest.approx(expected, abs=1e-12)
            found.append(measures.reward)
    assert found[0] == 0.0 and found[-1] > 0.95
    assert (np.diff(found) > 0.01).sum() == len(found) - 2  # The ways meet in equal points.


def test_routes_of_each_category_have_their_sizes_and_solids_leave_room_for_the_rope():
    ranges = {}
    for routes, ends in ROUTES.items():
        waves = np.array([_wave(routes, v)[:3] for v in SPLITS["all"]])
        assert set(waves[:, 0]) == {-1.0, 1.0}
        for values, (low, high) in zip(waves.T[1:], ends, strict=True):
            assert low <= values.min() < values.max() <= high
        ranges[routes] = waves[:, 1:]
    assert ranges["usual"][:, 0].max() < ranges["unseen"][:, 0].min()
    assert ranges["usual"][:, 1].min() > ranges["unseen"][:, 1].max()
    with pytest.raises(InvalidArgumentError, match="routes"):
        RouteCable(routes="short")


@pytest.mark.parametrize("routes", ROUTES)
def test_the_route_keeps_clear_of_pegs_and_jaws_of_the_model(routes):
    env = softgym_mj.load("route_cable", split="all", routes=routes)
    for variation in (1, 805):
        env.reset(variation)
        model = env.physics.model.ptr
        route = env.task.route(variation, 2001)
        for i in range(3):
            peg = model.geom(f"peg_{i}")
            away = np.hypot(*(route - peg.pos[:2]).T).min()
            # Its radius of curvature may be smaller than the peg with the rope around it.
            assert 0.8 * (PEG_RADIUS + RADIUS) < away < PEG_RADIUS + RADIUS + 1e-6
            assert peg.pos[2] == HEIGHT / 2
        for i in range(4):
            jaw = model.geom(f"jaw_{i}")
            turn = 2 * math.atan2(jaw.quat[3], jaw.quat[0])
            across = np.array([-math.sin(turn), math.cos(turn)])
            along = np.array([math.cos(turn), math.sin(turn)])
            beside = route[np.abs((route - jaw.pos[:2]) @ along) < 1e-3] - jaw.pos[:2]
            assert np.abs(beside @ across).min() - JAW[1] == pytest.approx(
                GAP / 2 - JAW[1], abs=2e-3
            )
    other = softgym_mj.load("route_cable", split="all", routes=[*ROUTES][routes == "usual"])
    with pytest.raises(SnapshotError, match="routes"):
        other.set_state(env.get_state())


@pytest.mark.long
@pytest.mark.parametrize("routes", ["usual", "unseen"])
def test_the_expert_routes_the_rope(routes):
    env = softgym_mj.load("route_cable", split="all", routes=routes)
    for _ in env.play(make_policy("scripted", env), 800):
        pass
    assert env.info()["normalized_performance"] > 0.85
    assert env.info()["gates_passed"] >= 0.6
    assert max(env.task.actor.held) < 0


def test_rows_of_a_batch_have_pegs_each():
    settings = {"observation": "full", "split": "all", "horizon": 20}
    envs = softgym_mj.make_vec("route_cable", 2, device="host", **settings)
    envs.reset(seed=0, options={"variation": [803, 811]})
    alone = []
    for variation in (803, 811):
        alone.append(softgym_mj.load("route_cable", **settings))
        alone[-1].reset(variation)
    random = np.random.default_rng(0)
    for k in range(20):
        actions = random.uniform(-0.3, 0.3, (2, 8)).astype(np.float32)
        actions[:, 1::4] += 0.3 if k > 4 else 0.0  # Towards the pegs,
        actions[:, 2::4] = -1.0 if k < 4 else 0.3 if k < 6 else -0.3  # down, and with the rope.
        actions[:, 3::4] = 1.0
        observations, *_ = envs.step(actions)
        for i, env in enumerate(alone):
            timestep = env.step(actions[i].astype(float))
            expected = timestep.observation["full"].astype(observations.dtype)
            np.testing.assert_array_equal(observations[i], expected)
    envs.close()
