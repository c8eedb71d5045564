"""RopeConfiguration: letters, the reward, what is drawn."""

import itertools

import numpy as np
import pytest

import softgym_mj
from softgym_mj import metrics
from softgym_mj.entities.rope import RADIUS
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering.offscreen import CameraView
from softgym_mj.tasks.rope_configuration import goal_name
from softgym_mj.tasks.shared.letters import LETTERS
from softgym_mj.tasks.shared.letters import letter as line

KEYS = [0, 4, 9, 13, 18, 22, 27, 31, 36, 40]

# SoftGym's letters (docs/softgym.md E): path length, extent along X and Y, and gap between the
# ends [m]; ours have a length of 0.5 m. SoftGym has 42, 45, 65, 41 and 41 points.
MEASURED = {
    "S": (0.516, 0.129, 0.185, 0.159), "O": (0.555, 0.166, 0.184, 0.011),
    "M": (0.805, 0.171, 0.190, 0.164), "C": (0.506, 0.158, 0.202, 0.091),
    "U": (0.504, 0.145, 0.200, 0.141),
}  # fmt: skip


def make(**kwargs):
    return softgym_mj.load("rope_configuration", **{"split": "evaluate", **kwargs})


def letter(name, count=41):
    """Vertices of a rope that lies as a letter."""
    return np.column_stack([line(name, count), np.full(count, RADIUS)])


def apart(env, pixels, goal):
    """Distances (m, n) [m] of m pixels of an image, on the floor, from the n vertices of a goal."""
    view = CameraView("task", *pixels.shape).calibration(env.physics)
    rows, columns = np.nonzero(pixels)
    seen = np.column_stack([columns, rows])
    near, far = (view.unproject(seen, np.full(len(seen), depth)) for depth in (0.0, 1.0))
    floor = near + (far - near) * (near[:, 2] / (near[:, 2] - far[:, 2]))[:, None]
    return np.hypot(floor[:, :1] - goal[:, 0], floor[:, 1:2] - goal[:, 1])


def place(env, vertices):
    env.task.rope.set_points(vertices)
    env.task.after_step(env.physics, None)
    return env.info()


@pytest.mark.parametrize("name", LETTERS)
def test_letters_are_as_long_as_the_rope_and_look_like_softgyms(name):
    points = letter(name)
    assert points.shape == (41, 3)
    np.testing.assert_allclose(points[:, 2], RADIUS)
    np.testing.assert_allclose(points.mean(axis=0)[:2], 0.0, atol=1e-12)
    spacing = np.linalg.norm(np.diff(points, axis=0), axis=1)
    # Chords of 12.5 mm of arc; shorter only across the corners of M.
    assert spacing.max() < 0.0125 + 1e-6
    assert np.sum(spacing < 0.0123) in ((1, 2, 3) if name == "M" else (0,))
    path, width, height, gap = MEASURED[name]
    scale = 0.5 / path
    np.testing.assert_allclose(
        np.ptp(points, axis=0)[:2], [scale * width, scale * height], atol=0.01
    )
    assert np.linalg.norm(points[0] - points[-1]) == pytest.approx(scale * gap, abs=0.01)


def test_matched_distance_is_the_best_of_all_permutations():
    random = np.random.default_rng(0)
    for _ in range(10):
        points, goal = random.normal(size=(2, 5, 3))
        best = min(
            np.mean([np.linalg.norm(points[i] - goal[j]) for i, j in enumerate(order)])
            for order in itertools.permutations(range(5))
        )
        assert metrics.matched_distance(points, goal) == pytest.approx(best, rel=1e-12)


@pytest.mark.parametrize("matching", ["key_points", "vertices"])
def test_a_rope_on_the_letter_scores_one_from_either_end(matching):
    env = make(matching=matching)
    env.reset(803)
    goal = letter(goal_name(803))
    assert env.info()["normalized_performance"] == 0.0
    for vertices in (goal, goal[::-1]):
        info = place(env, vertices)
        # Key points are not quite symmetrical: 0 4 9 ... 40 reads 0 4 9 ... from either end.
        assert info["normalized_performance"] == pytest.approx(1.0, abs=1e-6)
        assert info["success"]


def test_the_reward_by_hand():
    """A rope 1 m above the letter: every key point is 1 m from its own place."""
    env = make()
    env.reset(803)
    info = place(env, letter(goal_name(803)) + [0.0, 0.0, 1.0])
    assert info["performance"] == info["reward_matched_distance"] == pytest.approx(-1.0, abs=1e-9)


def test_every_letter_is_drawn_alike():
    names = [goal_name(i) for i in range(1000)]
    counts = {name: names.count(name) for name in LETTERS}
    assert sum(counts.values()) == 1000
    assert all(160 < count < 240 for count in counts.values()), counts  # 200, 3 sigma 38.


def test_observations_contain_the_goal():
    env = make(observation=["full", "reduced"])
    observation = env.reset(803).observation
    goal, rope = letter(goal_name(803)), env.task.rope.points()
    pickers = env.task.actor.positions()
    expected = [rope[KEYS], goal[KEYS], pickers]
    np.testing.assert_array_equal(observation["reduced"], np.concatenate(expected).ravel())
    np.testing.assert_array_equal(
        observation["full"], np.concatenate([rope, goal, pickers]).ravel()
    )


def test_the_letter_is_drawn_on_the_floor():
    env = make(observation="rgb", image_size=(256, 256), goal_marks=False)
    seen, view = {}, CameraView("task", 256, 256)
    for variation in (800, 801, 803, 812):
        observed = env.reset(variation).observation["rgb"].astype(int)
        image = view.rgb(env.physics).astype(int)
        red, tone, blue = np.moveaxis(image, -1, 0)
        green = (tone > red + 40) & (tone > blue + 20)
        assert not np.any((observed[..., 1] > observed[..., 0] + 40) & green)
        distance = apart(env, green, letter(goal_name(variation))).min(axis=1)
        assert len(distance) > 100 and distance.max() < 0.015
        seen[goal_name(variation)] = True
    assert len(seen) > 2


def test_the_goal_image_shows_the_rope_on_the_letter():
    env = make(observation="full")
    env.reset(803)
    act = np.random.default_rng(0).uniform(-1, 1, (6, 8))
    for action in act[:3]:
        env.step(action)
    snapshot = env.get_state()
    expected = [env.step(action).observation["full"] for action in act[3:]]
    env.set_state(snapshot)
    image = env.task.goal_image(env.physics, 200, 200).astype(int)
    np.testing.assert_array_equal(image, env.task.goal_image(env.physics, 200, 200))
    found = [env.step(action).observation["full"] for action in act[3:]]
    np.testing.assert_array_equal(found, expected)  # Looking changes nothing.
    goal = letter(goal_name(803))
    blue = apart(env, image[..., 2] > image[..., 0] + 60, goal)
    assert blue.min(axis=1).max() < 0.015 and blue.min(axis=0).max() < 0.01
    dark = apart(env, image.max(axis=2) < 60, goal)  # The rope's own shadow, but no picker.
    assert dark.min(axis=1).max(initial=0.0) < 0.025


def test_an_unknown_matching_names_the_choices():
    with pytest.raises(InvalidArgumentError, match=r"matching='bigraph'.*'key_points', 'vertices'"):
        make(matching="bigraph")


def test_the_goal_image_is_an_observation():
    env = make(observation=["reduced", "goal_rgb"], image_size=(40, 56))
    for variation in (803, 804):
        seen = env.reset(variation).observation["goal_rgb"]
        np.testing.assert_array_equal(seen, env.task.goal_image(env.physics, 40, 56))
        later = env.step(np.ones(8)).observation["goal_rgb"]
        np.testing.assert_array_equal(seen, later)
    assert env.observation_spec()["goal_rgb"].shape == (40, 56, 3)
