"""The recipes run as scripts of their own and do what their page says."""

import json
import os
import pathlib
import re
import runpy
import shlex
import subprocess
import sys
import types

import gymnasium
import imageio.v3 as imageio
import minari
import numpy as np
import pytest
import torch
from stable_baselines3 import SAC
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

import softgym_mj
from tests.command import output_of

PAGE = (pathlib.Path(__file__).parents[2] / "docs" / "recipes.md").read_text()
# Blocks by the heading above them.
RECIPES = {
    section.splitlines()[0]: re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    for section in PAGE.split("\n## ")[1:]
}
IDENTIFIER = "softgym_mj/StraightenRope-v0"
HORIZON = 75  # Horizon of straighten_rope.


@pytest.fixture(name="run")
def _run(tmp_path, monkeypatch, own_datasets):
    """Runs a recipe in a folder of its own; gives its variables."""
    monkeypatch.chdir(tmp_path)

    def run(heading: str, number: int = 0) -> types.SimpleNamespace:
        file = tmp_path / "recipe.py"  # Workers that are started anew read it.
        file.write_text(RECIPES[heading][number])
        return types.SimpleNamespace(**runpy.run_path(str(file), run_name="__main__"))

    return run


class Clip:
    """Stands in for MoviePy's `ImageSequenceClip` where it is missing.

    MoviePy 2.2 wants Pillow below 12 and mjviser Pillow from 12.2 on: no extra can bring both.
    """

    def __init__(self, frames, fps):
        self._frames, self._fps = frames, fps

    def write_videofile(self, file, **_):
        imageio.imwrite(file, np.array(self._frames), fps=self._fps)


@pytest.fixture(name="_moviepy")
def _fixture_moviepy(monkeypatch):
    try:
        import moviepy  # noqa: F401
    except ImportError:
        for name in ("moviepy", "moviepy.video", "moviepy.video.io"):
            monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
        module = types.ModuleType("moviepy.video.io.ImageSequenceClip")
        module.ImageSequenceClip = Clip
        monkeypatch.setitem(sys.modules, module.__name__, module)


@pytest.mark.usefixtures("_moviepy")
def test_videos_and_statistics(run, tmp_path):
    recipe = run("Gymnasium: videos and statistics")
    assert recipe.info["episode"]["l"] == 10 and -5.0 < recipe.info["episode"]["r"] < 0.0
    video = tmp_path / "videos" / "rl-video-episode-0.mp4"
    count, *size = imageio.imread(video).shape
    assert count in (10, 11) and size == [480, 480, 3]  # MoviePy leaves out the last frame.
    assert imageio.immeta(video)["fps"] == 12.5  # 0.08 s an env step.


def test_stacked_images(run):
    observation = run("Gymnasium: stacked images").observation
    assert observation.shape == (2, 64, 64, 3) and observation.dtype == np.uint8
    assert not np.array_equal(*observation)


def test_environments_side_by_side(run):
    recipe = run("Gymnasium: vector environments")
    assert recipe.observations.shape == (2, 36) and recipe.observations.dtype == np.float32
    assert not np.array_equal(*recipe.observations)
    assert recipe.truncated.all()
    np.testing.assert_allclose(
        recipe.rewards, (recipe.infos["final_info"]["normalized_performance"] - 1.0) / 2, rtol=1e-6
    )


def test_other_modes_name_autoreset_otherwise():
    mode = gymnasium.vector.AutoresetMode.SAME_STEP
    envs = gymnasium.make_vec(
        IDENTIFIER, num_envs=1, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}
    )
    assert "{'autoreset_mode': gymnasium.vector.AutoresetMode.SAME_STEP}".replace("'", '"') in PAGE
    assert envs.metadata["autoreset_mode"] is mode
    envs.close()


def test_checkpoints(run):
    recipe = run("Gymnasium: checkpoints")
    assert np.array_equal(recipe.resumed_observations, recipe.observations)
    for _ in range(12):  # Into the next episode.
        actions = recipe.envs.action_space.sample()
        one, other = recipe.envs.step(actions), recipe.resumed.step(actions)
        assert all(np.array_equal(*pair) for pair in zip(one[:4], other[:4], strict=True))
    recipe.envs.close(), recipe.resumed.close()


def test_a_single_checkpoint(run):
    recipe = run("Gymnasium: checkpoints", 1)
    assert np.array_equal(recipe.resumed_observation, recipe.observation)
    action = np.ones(8)
    assert np.array_equal(recipe.env.step(action)[0], recipe.resumed.step(action)[0])


def test_the_length_of_an_episode(run):
    recipe = run("Gymnasium: the length of an episode")
    assert recipe.observation.shape == (37,) and recipe.observation[-1] == 1.0
    assert [recipe.env.step(np.zeros(8))[3] for _ in range(49)] == [False] * 48 + [True]


def test_rewards_of_progress(run):
    recipe = run("Gymnasium: rewards of progress, scaled observations")
    gain = recipe.info["normalized_performance"] - recipe.start["normalized_performance"]
    assert len(recipe.rewards) == HORIZON
    assert sum(recipe.rewards) == pytest.approx(10.0 * gain, abs=1e-12)
    plain = recipe.env.unwrapped.dm_env.observation()["reduced"]
    np.testing.assert_allclose(recipe.observation, plain / 0.15, rtol=1e-6)


@pytest.mark.long
def test_sb3_states(run):
    model = run("Stable-Baselines3: states").model
    assert model.num_timesteps == 200 and model._n_updates >= 98
    assert [episode["l"] for episode in model.ep_info_buffer] == [HORIZON] * 2


def test_sb3_images(run):
    recipe = run("Stable-Baselines3: images")
    assert recipe.model.observation_space.shape == (6, 64, 64)  # Two images, colors first.
    assert recipe.envs.observation_space.shape == (64, 64, 6)
    assert recipe.action.shape == (1, 8) and np.abs(recipe.action).max() <= 1.0


def test_sb3_goals(run):
    recipe = run("Stable-Baselines3: goals")
    assert recipe.model._n_updates == 20 and recipe.reward < recipe.best == 0.0
    assert recipe.observation["observation"].shape == (36,)  # Without the goal.
    assert (recipe.model.replay_buffer.sample(64).rewards == 0.0).any()


def test_sb3_success_rates(run, tmp_path):
    model = run("Stable-Baselines3: success rates in TensorBoard").model
    (folder,) = (tmp_path / "runs").iterdir()
    log = EventAccumulator(str(folder)).Reload()
    (rate,) = log.Scalars("rollout/success_rate")
    scores = [episode["normalized_performance"] for episode in model.ep_info_buffer]
    threshold = softgym_mj.tasks.straighten_rope.StraightenRope.success
    assert rate.step == 150 and len(scores) == 2
    assert rate.value == np.mean(np.array(scores) >= threshold)


def test_sb3_evaluation(run, tmp_path, monkeypatch):
    env = gymnasium.make(IDENTIFIER, split="all")
    model = SAC("MlpPolicy", env, seed=0, device="cpu")
    model.save(tmp_path / "rope")
    run("Stable-Baselines3: evaluation")
    (tmp_path / "recipe.py").rename(tmp_path / "rope_policy.py")
    monkeypatch.syspath_prepend(tmp_path)
    (command,) = re.findall(r"^softgym-mj (evaluate .*rope_policy.*)$", PAGE, re.MULTILINE)
    output_of(*shlex.split(command))
    episodes = json.loads((tmp_path / "runs" / "sb3" / "result.json").read_text())["episodes"]
    assert [episode["variation"] for episode in episodes] == [800, 801]
    for episode in episodes:
        observation, _ = env.reset(options={"variation": episode["variation"]})
        truncated = False
        while not truncated:
            action, _ = model.predict(observation, deterministic=True)
            observation, *_, truncated, info = env.step(action)
        assert episode["normalized_performance"] == info["normalized_performance"]


def test_torchrl_environment(run):
    episode = run("TorchRL: an environment").episode
    assert episode.batch_size == (HORIZON,)
    assert episode["reduced"].shape == (HORIZON, 36)
    assert episode["rgb"].shape == (HORIZON, 64, 64, 3)
    assert (episode["reduced"].dtype, episode["rgb"].dtype) == (torch.float32, torch.uint8)
    ends = torch.arange(HORIZON)[:, None] == HORIZON - 1
    assert torch.equal(episode["next", "truncated"], ends)
    assert torch.equal(episode["next", "done"], ends)
    assert not episode["next", "terminated"].any()
    performance = episode["next", "normalized_performance"]
    torch.testing.assert_close(episode["next", "reward"][:, 0], (performance - 1.0) / 2)


def test_torchrl_of_many(run):
    batch = run("TorchRL: many environments in one").batch
    assert batch.batch_size == (4, 80)
    ends = (torch.arange(80) + 1) % HORIZON == 0
    assert torch.equal(batch["next", "truncated"][..., 0], ends.expand(4, -1))
    performance = batch["next", "normalized_performance"]
    torch.testing.assert_close(batch["next", "reward"], (performance - 1.0) / 2)
    starts = batch["observation"][:, [0, HORIZON]]
    assert not torch.equal(starts[:, 0], starts[:, 1])


def test_torchrl_scaled(run):
    from softgym_mj.vector.torchrl import TorchRLEnv

    batch = run("TorchRL: scaled observations and rewards").batch
    plain = TorchRLEnv("straighten_rope", 2, device="host")
    plain.set_seed(0)
    now = plain.reset()
    for step in range(10):
        torch.testing.assert_close(batch["observation"][:, step], now["observation"] / 0.15)
        now["action"] = batch["action"][:, step]
        ended, now = plain.step_and_maybe_reset(now)
        torch.testing.assert_close(batch["next", "reward"][:, step], 50.0 * ended["next", "reward"])
    plain.close()


@pytest.mark.long
def test_torchrl_collector(run):
    batches = run("TorchRL: a collector").batches
    assert [batch.batch_size for batch in batches] == [(2, 150)] * 2
    for batch in batches:
        ends = (torch.arange(150) + 1) % HORIZON == 0  # Two episodes in each environment.
        assert torch.equal(batch["next", "truncated"][..., 0], ends.expand(2, -1))
        assert not batch["next", "terminated"].any()
        # Within an episode the next observation is the one that the next step starts from.
        after = batch["next", "observation"][:, :-1][:, ~ends[:-1]]
        assert torch.equal(after, batch["observation"][:, 1:][:, ~ends[:-1]])


def test_dm_control_viewer(run, monkeypatch):
    """All of the viewer but its window, which needs a display."""
    from dm_control.viewer import application, runtime

    class Application:
        def __init__(self, **_):
            pass

        def launch(self, environment_loader, policy):
            self.runtime = runtime.Runtime(environment_loader, policy)
            errors = []
            self.runtime.on_error += errors.append
            while self.runtime.state is not runtime.State.STOPPED:
                self.runtime.tick(0.1, paused=False)
            assert not errors

    monkeypatch.setattr(application, "Application", Application)
    info = run("dm_control's viewer").env.info()
    assert info["normalized_performance"] > 0.95  # The expert has played an episode.


def test_minari_demonstrations(run):
    recipe = run("Minari: demonstrations")
    assert recipe.observations.shape == (2 * HORIZON, 36)
    assert recipe.actions.shape == (2 * HORIZON, 8)
    observation, _ = recipe.env.reset(options={"variation": 1})
    for action, recorded in zip(
        recipe.actions[HORIZON:], recipe.observations[HORIZON:], strict=True
    ):
        np.testing.assert_array_equal(observation, recorded)
        observation, *_ = recipe.env.step(action)


def test_minari_with_noise(run):
    recipe = run("Minari: demonstrations", 1)
    assert len(recipe.states) == len(recipe.labels) < HORIZON
    assert not np.array_equal(recipe.labels, recipe.episode.actions)


def test_minari_in_torchrl(run):
    recipe = run("Minari: demonstrations", 2)
    assert recipe.batch["observation"].shape == (64, 36)
    assert len(recipe.buffer) == 2 * HORIZON
    everything = recipe.buffer[:]
    for number, episode in enumerate(minari.load_dataset("rope/buffer-v0").iterate_episodes()):
        part = everything[number * HORIZON : (number + 1) * HORIZON]
        np.testing.assert_array_equal(part["observation"], episode.observations[:-1])
        np.testing.assert_array_equal(part["next", "observation"], episode.observations[1:])
        np.testing.assert_array_equal(part["action"], episode.actions)
        np.testing.assert_array_equal(part["next", "reward"][:, 0], np.float32(episode.rewards))
        np.testing.assert_array_equal(part["next", "done"][:, 0], np.arange(HORIZON) == HORIZON - 1)


def test_a_cloth_on_a_mesh(run):
    recipe = run("Custom scenes: a cloth on a mesh")
    assert recipe.cloth.points()[:, 2].max() == pytest.approx(0.06 + recipe.cloth.radius, abs=0.01)


def test_lerobot(run, tmp_path, monkeypatch):
    reason = "needs LeRobot, whose PyTorch is older than that of the tests"
    constants = pytest.importorskip("lerobot.utils.constants", reason=reason)
    monkeypatch.setattr(constants, "HF_LEROBOT_HOME", tmp_path / "lerobot")
    monkeypatch.setenv("HF_LEROBOT_HOME", str(tmp_path / "lerobot"))
    section = PAGE.split("\n## LeRobot: ")[1]
    shown = re.search(r"```sh\n(.*?)```", section, re.DOTALL)[1].replace("\\\n", " ")
    shown = shown.replace("episodes 200", "episodes 2").replace("=2000", "=2")
    recording, training, evaluation = map(shlex.split, shown.splitlines())
    output_of(*recording[1:])
    learn = [sys.executable, "-m", "lerobot.scripts.lerobot_train", *training[1:]]
    subprocess.run(learn, check=True, env={**os.environ, "HF_HUB_OFFLINE": "1"})
    make = run("LeRobot: a policy from demonstrations").make
    (tmp_path / "recipe.py").rename(tmp_path / "act_policy.py")
    monkeypatch.syspath_prepend(tmp_path)
    output_of(*evaluation[1:])
    episodes = json.loads((tmp_path / "runs" / "act" / "result.json").read_text())["episodes"]
    assert [episode["variation"] for episode in episodes] == [800, 801]
    for episode in episodes:
        env = softgym_mj.load(
            "straighten_rope", split="all", observation=["proprioception", "reduced"]
        )
        for _ in env.play(make(env), episode["variation"]):
            pass
        assert episode["normalized_performance"] == env.info()["normalized_performance"]


def test_every_recipe_is_tested():
    source = pathlib.Path(__file__).read_text()
    for heading, codes in RECIPES.items():
        for number in range(len(codes)):
            call = f'run("{heading}")' if number == 0 else f'run("{heading}", {number})'
            assert call in source
