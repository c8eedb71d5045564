"""The task fold_shirt: places of a folded shirt, its score, its starts and its expert."""

import dataclasses

import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities.shirt import KEYS, Cut, Shirt
from softgym_mj.exceptions import InvalidArgumentError, SnapshotError
from softgym_mj.learning.symmetries import symmetries
from softgym_mj.policies.factory import make_policy
from softgym_mj.robots.arm.grasps import AttachGrasp, FrictionGrasp
from softgym_mj.tasks.fold_shirt import LOWER, STACK, FoldShirt, folded, with_sleeves_in
from softgym_mj.tasks.shared.observations import STATES
from softgym_mj.tasks.shared.starts.shirts import CUTS, FlatShirt
from softgym_mj.variations.indices import SPLITS

SHORT, LONG = 811, 806  # Variations with short and long sleeves.


@pytest.fixture(scope="module")
def env():
    env = softgym_mj.load("fold_shirt", split="evaluate", fidelity="fast")
    env.reset(LONG)
    return env


def measured(env, points):
    """Measures of the shirt with its vertices at points (n, 3) [m]."""
    task = env.task
    return task.measure(task.state()._replace(points={"shirt": points}), task.episode)


@pytest.mark.parametrize("sleeve", [0.15, 0.4])
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_places_are_mirror_images_about_armholes_and_the_middle(sleeve, angle):
    cut = Cut(sleeve=sleeve, sleeve_angle=0.7)
    shirt = Shirt(cut)
    # The pattern's own frame: X from the middle, Y from the hem.
    x, y = (shirt.laid() - shirt.laid()[shirt.keys[[0, -1]]].mean(axis=0))[:, :2].T
    is_sleeve = (abs(x) > cut.chest + 1e-9) & (y > cut.armpit - cut.sleeve)
    x = np.where(is_sleeve & (shirt.arrays["body"] == 0.0), np.sign(x) * 2 * cut.chest - x, x)
    shoulders = cut.length - cut.shoulder_drop
    sleeves_in = np.column_stack([x, y])
    expected = np.column_stack([x, np.maximum(y, shoulders - y)])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    flat = shirt.laid((0.3, -0.2), angle)[:, :2]
    origin = flat[shirt.keys[[0, -1]]].mean(axis=0)
    found = with_sleeves_in(flat, shirt.arrays)
    np.testing.assert_allclose(found, sleeves_in @ turn + origin, atol=1e-9)
    np.testing.assert_allclose(folded(flat, shirt.arrays), expected @ turn + origin, atol=1e-9)


def test_a_folded_shirt_scores_the_upper_bound_and_a_flat_one_the_lower(env):
    task, radius = env.task, env.task.shirt.radius
    places = task.episode.goal["places"]
    lower, upper = task.bounds(task.episode)
    flat = np.column_stack([places, np.full(len(places), radius)])
    assert measured(env, flat).performance == upper == 0.0
    assert measured(env, task.episode.points["shirt"]).performance == lower < -0.1
    # A stack has its height, a shirt in the air lies nowhere.
    assert measured(env, flat + [0.0, 0.0, STACK - radius]).performance == 0.0
    high = measured(env, flat + [0.0, 0.0, STACK + 0.1 - radius])
    assert high.performance == pytest.approx(-0.1)


def test_terms_are_shares_of_the_mean_distance_over_the_area(env):
    episode, shape = env.task.episode, env.task.shirt.arrays
    flat = episode.points["shirt"]
    start, corners = measured(env, flat), flat[env.task.shirt.triangles]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    away = np.linalg.norm(flat[:, :2] - episode.goal["places"], axis=1)
    means = away[env.task.shirt.triangles].mean(axis=1)
    assert start.performance == pytest.approx(-np.average(means, weights=areas), rel=1e-3)
    assert start.performance == sum(start.rewards.values())
    in_place = flat.copy()
    own = shape["body"] == 0.0
    in_place[own, :2] = episode.goal["places"][own]
    rewards = measured(env, in_place).rewards
    assert rewards["sleeve_distance"] > 0.1 * start.rewards["sleeve_distance"]
    assert rewards["body_distance"] == start.rewards["body_distance"]


@pytest.mark.parametrize("variation", [SHORT, LONG])
def test_shirts_start_at_rest_and_doing_nothing_scores_nothing(env, variation):
    env.reset(variation)
    before, zero = env.task.shirt.points(), np.zeros(env.action_spec().shape)
    for _ in range(5):
        env.step(zero)
    assert abs(env.task.shirt.points() - before).max() < 1e-3
    assert abs(env.info()["normalized_performance"]) < 2e-3
    assert env.task.shirt.intersections() == 0
    keys = dict(zip(KEYS, before[env.task.shirt.keys], strict=True))
    assert keys["collar"][0] > keys["left hem"][0] and keys["left cuff, outer end"][1] < 0.0


def test_cuts_of_each_category_and_those_that_no_training_variation_has():
    cuts = {name: [FlatShirt(cuts=name).cut(v) for v in SPLITS["all"]] for name in CUTS}
    sleeves = np.array([cut.sleeve for cut in cuts["usual"]])
    short = sleeves < 0.21
    assert 0.4 < short.mean() < 0.6 and sleeves[~short].min() > 0.32
    for name in ("length", "flare", "waist"):
        usual, unseen = ([getattr(cut, name) for cut in cuts[key]] for key in CUTS)
        assert max(usual) < min(unseen)
    # Sleeves end on the shirt when they are folded in.
    for cut in cuts["usual"]:
        sine, cosine = np.sin(cut.sleeve_angle), np.cos(cut.sleeve_angle)
        lowest = cut.armpit + cut.armhole / 2 - cut.sleeve * sine - cut.cuff / 2 * cosine
        assert lowest > 0.0 and cut.sleeve * cosine + cut.cuff / 2 * sine < 2 * cut.chest
    with pytest.raises(InvalidArgumentError, match="cuts"):
        FoldShirt(cuts="trousers")


def test_symmetries_keep_the_score_and_move_the_observation(env):
    task, shirt = env.task, env.task.shirt
    env.reset(LONG)
    rest = shirt.laid()
    apart = np.linalg.norm(rest[:, None] * [-1.0, 1.0, 1.0] - rest, axis=2)
    partner = apart.argmin(axis=1)  # The same vertex of the other side.
    flat = task.episode.points["shirt"]
    points = flat + np.random.default_rng(0).normal(0.0, 0.05, flat.shape)
    state = task.state()._replace(points={"shirt": points})
    expected = task.measure(state, task.episode).performance
    seen = STATES["reduced"].value(task, state, task.episode)
    found = symmetries(env, "reduced")
    assert len(found) == 16
    for turn in found:
        order = partner if turn.order == "reversed" else np.arange(len(partner))
        moved, start = (each[order] @ turn.turn.T for each in (points, flat))
        sensed = state.sensed.reshape(2, 3)[list(turn.pickers)] @ turn.turn.T
        other = state._replace(points={"shirt": moved}, sensed=sensed.ravel())
        goal = {"places": folded(start[:, :2], shirt.arrays)}
        episode = dataclasses.replace(task.episode, goal=goal)
        assert task.measure(other, episode).performance == pytest.approx(expected, rel=1e-6)
        np.testing.assert_allclose(
            STATES["reduced"].value(task, other, episode), turn.observation @ seen, atol=1e-9
        )


def play(variation, **settings):
    env = softgym_mj.load("fold_shirt", split="all", count_intersections=True, **settings)
    for _ in env.play(make_policy("scripted", env), variation):
        pass
    return env


@pytest.mark.parametrize(
    ("variation", "cuts", "fidelity"),
    [
        (LONG, "usual", "fast"),
        pytest.param(LONG, "usual", "default", marks=pytest.mark.long),
        *(pytest.param(SHORT, cuts, "default", marks=pytest.mark.long) for cuts in CUTS),
    ],
)
def test_the_expert_folds_shirts_and_dresses_without_crossing_layers(variation, cuts, fidelity):
    env = play(variation, cuts=cuts, fidelity=fidelity)
    assert env.info()["normalized_performance"] > 0.8
    assert env.info()["intersections"] == 0
    assert max(env.task.actor.held) < 0
    assert env.task.shirt.points()[:, 2].max() < STACK


@pytest.mark.long
@pytest.mark.parametrize(
    ("actor", "variation"),
    [
        ("sawyer", 920),  # Two hands at one cuff block each other: 0.2.
        ("ur5e", 940),  # A hand that closes before it rests misses the floor by 2 mm: 0.3.
        ("franka", 111),  # The hem springs open: 0.7.
    ],
)
def test_arms_fold_shirts(actor, variation):
    assert play(variation, actor=actor).info()["normalized_performance"] > 0.8


def test_a_snapshot_of_other_cuts_is_refused(env):
    with pytest.raises(SnapshotError, match="cuts"):
        softgym_mj.load("fold_shirt", split="all", cuts="unseen").set_state(env.get_state())


@pytest.mark.long
def test_arms_fold_a_shirt():
    env = play(SHORT, actor="franka", fidelity="fast")
    assert env.info()["normalized_performance"] > 0.6
    assert env.info()["picks_held"] == 0


def lowest(task, **settings):
    """Height [m] of the lowest point that grippers can be sent to."""
    env = softgym_mj.load(task, split="all", fidelity="fast", **settings)
    env.reset(0)
    return env.task.actor.limits[0][2]


def test_hands_come_as_near_to_a_shirt_as_to_a_thicker_cloth():
    assert pytest.approx((0.01 - 0.003) / 2.0) == LOWER
    pads, attached = 0.01875, AttachGrasp.tip_clearance  # [m] Of a UR5e.
    assert lowest("fold_cloth", actor="ur5e") == pads + attached
    assert lowest("fold_shirt", actor="ur5e") == pytest.approx(pads + attached - LOWER, abs=1e-12)
    # Grasps by friction are as low as they can be, and pickers have no fingers.
    friction = pads + FrictionGrasp.tip_clearance
    assert lowest("fold_shirt", actor="ur5e", grasp="friction") == friction
    assert lowest("fold_shirt") == lowest("fold_cloth")


@pytest.mark.long  # By default, the test above compares how low these hands come.
def test_the_longest_pads_catch_a_lower_layer():
    assert play(SHORT, actor="ur5e").info()["normalized_performance"] > 0.5
