"""`play` keeps what an episode was; videos and pictures show what they are given."""

import base64
import re

import gymnasium
import imageio.v3 as imageio
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

import softgym_mj
from softgym_mj.evaluation import plots
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.policies import experts
from softgym_mj.policies.episodes import play
from softgym_mj.policies.factory import make_policy
from softgym_mj.policies.model_predictive import ModelPredictivePolicy
from softgym_mj.policies.planners import CEM
from softgym_mj.rendering.offscreen import CameraView, Video

RED, BLUE = (200, 30, 30), (30, 30, 200)


@pytest.fixture(name="env", scope="module")
def _env():
    return softgym_mj.load("straighten_rope", split="evaluate", horizon=4)


def still(color, count=1, size=64):
    return np.full((count, size, size, 3), color, np.uint8)


def test_an_episode_is_what_a_loop_over_its_steps_sees(env):
    def act(timestep):
        return np.full(8, 0.5)

    counted = []
    episode = play(env, act, 803, size=48, on_step=lambda: counted.append(env.step_count))
    timestep, view = env.reset(803), CameraView("task", 48, 48)
    rewards, scores, frames = [], [env.info()["normalized_performance"]], [view.rgb(env.physics)]
    while not timestep.last():
        timestep = env.step(act(timestep))
        rewards.append(timestep.reward)
        scores.append(env.info()["normalized_performance"])
        frames.append(view.rgb(env.physics))
    assert episode.rewards.tolist() == rewards and len(rewards) == 4
    assert episode.info["normalized_performance"].tolist() == scores
    assert set(episode.info) == set(env.info())
    np.testing.assert_array_equal(episode.frames, frames)
    assert episode.fps == pytest.approx(12.5)  # 8 sim steps of 0.01 s.
    assert counted == [1, 2, 3, 4]
    some = play(env, act, 803, size=48, pictures=(0, 3))
    np.testing.assert_array_equal(some.frames, [frames[0], frames[3]])


def test_videos_of_pick_and_place_run_in_about_real_time():
    env = softgym_mj.load("straighten_rope", actor="pick_and_place", horizon=3, split="all")
    episode = play(env, "random", 800, camera=None)
    seconds = 0.01 * episode.info["sim_steps"][1:].sum()
    assert len(episode.rewards) / episode.fps == pytest.approx(seconds, rel=0.3)


def test_policies_are_played_by_name(env):
    first, second, other = (play(env, "random", 803, seed=s, camera=None) for s in (0, 0, 1))
    assert first.rewards.tolist() == second.rewards.tolist() != other.rewards.tolist()
    assert first.frames.shape == (0, 240, 240, 3) and first._repr_html_() is None
    with pytest.raises(InvalidArgumentError, match="frames="):
        _ = first.video
    for settings, message in (
        ({"policy": "best"}, "'scripted'"),
        ({"camera": "side"}, r"camera='side'.*'overview'"),
        ({"size": 0}, "size=0"),
    ):
        with pytest.raises(InvalidArgumentError, match=message):
            play(env, **settings)


def test_a_video_has_its_frames_in_order(tmp_path):
    frames = np.concatenate([still(RED, 3), still(BLUE, 2)])
    Video(frames, fps=5).write(tmp_path / "new" / "video.mp4")
    seen = imageio.imread(tmp_path / "new" / "video.mp4").astype(int)
    assert seen.shape == frames.shape
    assert np.abs(seen - frames).max() < 25  # Compressed.
    assert imageio.immeta(tmp_path / "new" / "video.mp4")["fps"] == 5


def test_a_notebook_gets_the_video_itself(tmp_path):
    html = Video(still(RED, 4), fps=12.5)._repr_html_()
    assert html.startswith("<video") and 'width="64"' in html
    data = re.search('base64,([^"]+)"', html)[1]
    (tmp_path / "video.mp4").write_bytes(base64.b64decode(data))
    assert imageio.imread(tmp_path / "video.mp4").shape == (4, 64, 64, 3)


@pytest.mark.parametrize(
    "frames",
    [np.zeros((0, 8, 8, 3), np.uint8), np.zeros((2, 8, 8, 3)), np.zeros((8, 8, 3), np.uint8)],
    ids=["none", "float", "one picture"],
)
def test_a_video_is_made_of_pictures(frames):
    with pytest.raises(InvalidArgumentError, match=re.escape(str(frames.shape))):
        Video(frames, fps=5)


def test_pictures_are_shown_in_rows_with_titles(monkeypatch):
    matplotlib.use("Agg")
    figures = []
    monkeypatch.setattr(plt, "show", lambda: figures.append(plt.gcf()))
    numbers = np.arange(64.0).reshape(8, 8)
    plots.show([still(RED)[0], still(BLUE)[0], numbers], ["red", "blue", "numbers"], columns=2)
    (figure,) = figures
    assert [axes.get_title() for axes in figure.axes] == ["red", "blue", "numbers", ""]
    drawn = [axes.images[0].get_array() for axes in figure.axes[:3]]
    np.testing.assert_array_equal(drawn[1], still(BLUE)[0])
    np.testing.assert_array_equal(drawn[2], numbers)
    with pytest.raises(InvalidArgumentError, match="one for each of 2"):
        plots.show([numbers, numbers], ["one"])


@pytest.mark.parametrize(
    "bind",
    [
        play,
        lambda env: make_policy("zero", env),
        experts.make_policy,
        lambda env: ModelPredictivePolicy(env, CEM(1), rollouts=None),
    ],
)
def test_an_environment_of_gymnasium_has_the_one_that_policies_need(bind):
    env = gymnasium.make("softgym_mj/StraightenRope-v0", fidelity="fast")
    with pytest.raises(InvalidArgumentError, match=r"load, or env\.unwrapped\.dm_env of Gymnasium"):
        bind(env)
    env.close()
