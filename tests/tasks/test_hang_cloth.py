"""The task hang_cloth: its score of cloths in known places, its bars, and its expert."""

import math

import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities.cloth import PARTICLE_SPACING
from softgym_mj.exceptions import InvalidArgumentError, SnapshotError
from softgym_mj.policies.factory import make_policy
from softgym_mj.tasks.hang_cloth import (
    BAR_X,
    BARS,
    CLEAR,
    FRICTION,
    HALF_LENGTH,
    RESTING,
    HangCloth,
    across,
    passage,
)
from softgym_mj.variations.indices import SPLITS

HALF = 0.005  # [m] Half the thickness of cloth.


@pytest.fixture(scope="module")
def env():
    env = softgym_mj.load("hang_cloth", split="evaluate", fidelity="accurate")
    env.reset(800)
    return env


def score(env, points):
    """Performance of the cloth with its vertices at points (n, 3) [m]."""
    task = env.task
    state = task.state()._replace(points={"cloth": points})
    return task.measure(state, task.episode)


def draped(env, share):
    """Vertices (n, 3) [m] of a cloth over the bar of which a share hangs on the side of +X.

    An arc lies on the bar, straight parts hang below its ends.
    """
    x, z, radius = env.task.episode.goal["bar"]
    radius += HALF
    flat, length = env.task.cloth.flat(), env.task.cloth.size[0]
    along = flat[:, 0] + (share - 0.5) * length  # Arc length from the top.
    end = radius * math.pi / 2
    angle = np.clip(along, -end, end) / radius
    down = np.maximum(abs(along) - end, 0.0)
    places = x + radius * np.sin(angle), flat[:, 1], z + radius * np.cos(angle) - down
    return np.column_stack(places)


def test_an_evenly_hanging_cloth_scores_the_upper_bound(env):
    measures = score(env, draped(env, 0.5))
    assert measures.performance == pytest.approx(1.0, abs=2e-3)
    assert measures.reward == pytest.approx(1.0, abs=2e-3)
    assert env.task.bounds(env.task.episode) == (0.0, 1.0)


def passed(env, points):
    """Mean signed distance [m] of the cloth with its vertices at points (n, 3) [m] from the bar."""
    task = env.task
    bar = task.episode.goal["bar"]
    return passage(across(task.cloth.arrays, points, bar), bar)


def test_the_passage_is_the_mean_signed_distance_from_the_top_of_the_bar(env):
    columns, ones = 5, np.ones(2)
    shape = {  # Its vertices are the particles.
        "grid": np.arange(2 * columns).reshape(2, columns),
        "by_row": np.eye(2),
        "by_column": np.eye(columns),
        "rows": ones,
        "columns": np.ones(columns),
    }
    x, z, radius = bar = np.array([0.1, 0.33, 0.02])
    near, far, above = (-0.3, -0.4), (0.5, -1.2), (0.01, 0.2)  # Distances 0.5, 1.3 and 0.2002 m.
    top = math.hypot(*above)
    for places, expected in (
        ([near] * 5, -0.5),
        ([near, near, far, far, far], -(2 * 0.5 + 3 * 1.3) / 5),  # Below the bar.
        ([near, near, above, far, far], (-2 * 0.5 + top + 2 * 1.3) / 5),  # Over it.
        ([near, near, near, near, above], (-4 * 0.5 + top) / 5),
    ):
        along, height = np.array(places * 2).T
        points = np.column_stack([x + along, np.repeat([-0.2, 0.2], columns), z + radius + height])
        assert passage(across(shape, points, bar), bar) == pytest.approx(expected, abs=1e-12)
    for share in (0.2, 0.5, 0.65):
        # Distances grow evenly on both sides; chords of the bar are up to 1 cm shorter than arcs.
        expected = (2.0 * share - 1.0) * env.task.cloth.size[0] / 2.0
        assert passed(env, draped(env, share)) == pytest.approx(expected, abs=0.01)


def test_the_reward_grows_along_the_way_over_the_bar(env):
    x, z, radius = env.task.episode.goal["bar"]
    flat, length = env.task.cloth.flat(), env.task.cloth.size[0]
    from_end = length / 2.0 - flat[:, 0]

    def lifted(height):
        """Held by the last column beside the bar; what does not hang lies on the floor."""
        down = np.minimum(from_end, height)
        places = x - 0.1 - (from_end - down), flat[:, 1], np.maximum(height - down, HALF)
        return np.column_stack(places)

    way = [lifted(height) for height in np.linspace(0.02, z + radius, 8)]
    way += [draped(env, share) + [0.0, 0.0, 0.05] for share in (0.1, 0.2, 0.3)]  # Above the bar.
    way += [draped(env, share) for share in (0.3, 0.4, 0.5)]
    measures = [score(env, points) for points in way]
    assert (np.diff([each.reward for each in measures]) > 0.01).all()
    assert [each.performance > 0.0 for each in measures] == [False] * 11 + [True] * 3
    start = abs(passed(env, env.task.episode.points["cloth"]))
    for points, each in zip(way, measures, strict=True):
        approach = 1.0 - abs(passed(env, points)) / start
        expected = each.performance + (1.0 - each.performance) * approach / 2.0
        assert each.reward == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("share", [0.3, 0.4, 0.65])
def test_a_cloth_scores_twice_its_smaller_part(env, share):
    measures = score(env, draped(env, share))
    # The mesh cuts off the arc: some millimeters of half a meter.
    assert measures.performance == pytest.approx(2.0 * min(share, 1.0 - share), abs=0.02)
    assert measures.info["hanging_far"] == pytest.approx(share, abs=0.01)
    assert measures.info["hanging_near"] == pytest.approx(1.0 - share, abs=0.01)


@pytest.mark.parametrize("width", [0.3, 0.75, 1.0, 1.1])
def test_a_bunched_cloth_scores_the_share_of_its_width_that_is_left(env, width):
    points = draped(env, 0.5)
    points[:, 1] = 0.1 + width * points[:, 1]
    measures = score(env, points)
    assert measures.info["spread"] == pytest.approx(min(width, 1.0), rel=1e-9)
    near, far = (measures.info[f"hanging_{side}"] for side in ("near", "far"))
    assert measures.performance == 2.0 * measures.info["spread"] * min(near, far)


def test_a_cloth_doubled_along_the_bar_scores_half(env):
    points = draped(env, 0.5)
    points[:, 1] = abs(points[:, 1])
    assert score(env, points).performance == pytest.approx(0.5, abs=0.01)


def test_what_lies_on_the_floor_does_not_hang(env):
    points = draped(env, 0.5)
    lowest = points[:, 2].min()
    _, z, radius = env.task.episode.goal["bar"]
    # Let the far side fold at the floor, as if the towel had been longer: a quarter lies on it.
    far = points[:, 0] > BAR_X
    cut = np.quantile(points[far, 2], 0.5)
    lying = far & (points[:, 2] < cut)
    share = lying.mean()
    points[lying, 0], points[lying, 2] = points[lying, 0].mean(), HALF
    measures = score(env, points)
    assert measures.info["hanging_near"] == pytest.approx(0.5, abs=5e-3)
    # Edges between the two parts hang by half.
    assert measures.info["hanging_far"] == pytest.approx(0.5 - share, abs=0.05)
    assert measures.performance == 2.0 * measures.info["spread"] * measures.info["hanging_far"]
    assert lowest > CLEAR and z > radius


def test_cloths_that_do_not_hang_over_the_bar_score_nothing(env):
    x, z, radius = env.task.episode.goal["bar"]
    flat = env.task.cloth.flat()
    floor = flat + [x, 0.0, HALF]  # Below the bar, half on each side.
    beside = draped(env, 0.5) + [0.0, 0.0, -2 * radius - 0.03]  # Held in the air, below the bar.
    above = flat + [x, 0.0, z + 0.1]
    one_side = draped(env, 0.5) + [2 * radius + 0.02, 0.0, 0.0]
    aside = draped(env, 0.5) + [0.0, 0.6, 0.0]  # Held in the air, beyond a post.
    for points in (floor, beside, above, one_side, aside):
        assert score(env, points).performance == 0.0


def test_only_cloth_between_the_posts_hangs(env):
    # Its flat width is cut in halves by a post.
    points = draped(env, 0.5) + [0.0, HALF_LENGTH, 0.0]
    assert score(env, points).performance == pytest.approx(0.5, abs=0.03)


def test_doing_nothing_scores_nothing(env):
    env.reset(801)
    zero = np.zeros(env.action_spec().shape)
    rewards = [env.step(zero).reward for _ in range(5)]
    assert rewards == pytest.approx([0.0] * 5, abs=1e-6)
    assert env.info()["normalized_performance"] == 0.0
    points = env.task.cloth.points()
    assert points[:, 2].max() < RESTING and points[:, 0].max() < BAR_X


def test_bars_of_each_category_have_their_sizes_and_are_those_of_the_model():
    ranges = {}
    for bars, ends in BARS.items():
        task = HangCloth(bars=bars)
        sizes = np.array([task.bar(v) for v in SPLITS["all"]])
        for values, (low, high) in zip(sizes.T, ends, strict=True):
            assert low <= values.min() < values.max() <= high
            assert values.max() - values.min() > 0.9 * (high - low)
        ranges[bars] = sizes
    usual, unseen = ranges["usual"], ranges["unseen"]
    assert (usual.max(axis=0) < unseen.min(axis=0)).all()
    env = softgym_mj.load("hang_cloth", split="all", bars="unseen")
    for variation in (3, 804):
        env.reset(variation)
        height, radius = env.task.bar(variation)
        geom = env.physics.model.ptr.geom("bar")
        assert (geom.size[0], geom.pos[2]) == (radius, height)
        np.testing.assert_array_equal(env.task.episode.goal["bar"], [BAR_X, height, radius])
    with pytest.raises(InvalidArgumentError, match="bars"):
        HangCloth(bars="low")
    with pytest.raises(SnapshotError, match="bars"):
        softgym_mj.load("hang_cloth", split="all").set_state(env.get_state())


def test_the_longest_towel_hangs_clear_of_the_floor():
    (lowest, _), _ = BARS["usual"]
    start = HangCloth().start
    longest = max(start.dims(v)[0] for v in SPLITS["all"])
    assert (longest - 1) * PARTICLE_SPACING / 2 < lowest - CLEAR


def play(variation, **settings):
    """The environment after an episode of the expert, and rewards and performances (n,) of it."""
    env, found = softgym_mj.load("hang_cloth", split="all", **settings), []
    timestep = env.reset(variation)
    policy = make_policy("scripted", env)
    while not timestep.last():
        timestep = env.step(policy(timestep))
        found.append((timestep.reward, env.task.last_evaluation.performance))
    return env, *np.array(found).T


@pytest.mark.parametrize("bars", BARS)
def test_the_expert_hangs_the_towel_which_touches_the_bar_without_entering_it(bars):
    env, rewards, performances = play(803, bars=bars)
    assert env.info()["normalized_performance"] > 0.8
    # The reward leads there: it grows from the grasp until the towel lies on the bar.
    before = rewards[: np.argmax(performances > 0.0)]
    assert (
        before[-1] > 0.3 and (np.diff(before) > -1e-6).all() and (np.diff(before[-8:]) > 0.01).all()
    )
    assert max(env.task.actor.held) < 0
    x, z, radius = env.task.episode.goal["bar"]
    particles = env.task.cloth.particles()
    away = np.hypot(particles[..., 0] - x, particles[..., 2] - z).min()
    assert radius + HALF - 1e-3 < away < radius + HALF + 2e-3
    assert env.info()["max_speed"] < 0.3


@pytest.mark.parametrize("actor", ["franka"])
def test_arms_hang_the_towel(actor):
    env, _, _ = play(804, actor=actor)
    assert env.info()["normalized_performance"] > 0.6
    assert env.info()["picks_held"] == 0


@pytest.mark.parametrize("share", [0.15, 0.45])
def test_a_towel_that_hangs_by_an_edge_slides_off_and_another_stays(env, share):
    env.reset(800)
    points = draped(env, share)
    env.task.cloth.set_points(points)
    assert score(env, points).performance == pytest.approx(2 * share, abs=0.03)
    zero = np.zeros(env.action_spec().shape)
    for _ in range(25):
        env.step(zero)
    performance = env.task.last_evaluation.performance
    if share < 1.0 / (1.0 + math.exp(math.pi * FRICTION)):  # By the capstan equation.
        assert performance == 0.0
        assert env.task.cloth.points()[:, 2].max() < 0.1
    else:
        assert performance == pytest.approx(2 * share, abs=0.06)
