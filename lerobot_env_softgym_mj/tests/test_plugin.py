"""LeRobot's own functions and commands are the oracle: its datasets, rollouts and training."""

import functools
import json
import subprocess
import sys

import gymnasium
import imageio.v3 as imageio
import numpy as np
import pytest
from lerobot.envs import EnvConfig, env_to_policy_features, make_env, preprocess_observation
from lerobot.utils import constants
from lerobot.utils.feature_utils import dataset_to_policy_features
from lerobot.utils.import_utils import register_third_party_plugins

import softgym_mj
from softgym_mj.exceptions import SoftGymError
from softgym_mj.policies.episodes import play
from softgym_mj.policies.factory import make_policy
from softgym_mj.recording import record

register_third_party_plugins()
Config = functools.partial(EnvConfig.get_choice_class("softgym_mj"), image_size=(48, 64))
ROPE, SEED = "straighten_rope", 1000  # The seed is LeRobot's default.


@pytest.fixture(name="home", autouse=True, scope="module")
def _home(tmp_path_factory):
    """Folder of datasets, also of subprocesses, which have no network."""
    with pytest.MonkeyPatch.context() as patch:
        home = tmp_path_factory.mktemp("lerobot")
        patch.setattr(constants, "HF_LEROBOT_HOME", home)
        patch.setenv("HF_LEROBOT_HOME", str(home))
        patch.setenv("HF_HUB_OFFLINE", "1")
        yield home


@pytest.mark.parametrize(
    ("task", "actor", "observation"),
    [
        (ROPE, None, ["proprioception", "markov", "rgb", "held"]),
        ("fold_cloth", "franka", ["proprioception", "rgb", "wrist_rgb", "external_rgb", "depth"]),
        (ROPE, "sawyer", ["proprioception", "reduced"]),
        ("pour_water", "ur5e", ["reduced"]),
        ("transport_water", None, ["proprioception", "full"]),
    ],
)
def test_environment_and_recorded_dataset_have_the_same_features(task, actor, observation):
    how = {"observation": observation, "image_size": (48, 64)}
    how |= {} if actor is None else {"actor": actor}
    dataset = record(task, [800], format="lerobot", horizon=2, **how)
    config = Config(task=task, actor=actor, observation=observation, episode_length=2)
    expected = dataset_to_policy_features(dataset.meta.features)
    assert {k: (f.type, tuple(f.shape)) for k, f in env_to_policy_features(config).items()} == {
        k: (f.type, tuple(f.shape)) for k, f in expected.items()
    }
    assert config.fps == dataset.meta.fps
    envs = make_env(config)["softgym_mj"][0]
    row, (seen, _) = dataset[0], envs.reset(seed=[SEED])
    assert envs.observation_space.contains(seen)
    assert envs.call("task_description") == (row["task"],)
    for key, value in preprocess_observation(seen).items():
        if "images" not in key:  # Videos lose details.
            np.testing.assert_array_equal(value[0].numpy(), row[key].numpy(), err_msg=key)
    envs.close()


def test_episodes_reset_in_the_same_step_and_succeed_at_their_end():
    env = softgym_mj.load(ROPE, split="evaluate")
    actions = []
    expert = make_policy("scripted", env)
    episode = play(env, lambda time: actions.append(expert(time)) or actions[-1], 801, camera=None)
    config = Config(observation=["proprioception", "reduced"])
    envs = make_env(config, n_envs=2)["softgym_mj"][0]
    assert envs.metadata["autoreset_mode"] is gymnasium.vector.AutoresetMode.SAME_STEP
    assert envs.call("_max_episode_steps") == (75, 75)
    _, info = envs.reset(seed=[SEED + 201, SEED])  # Seeds count through the split.
    np.testing.assert_array_equal(info["variation"], [801, 800])
    for k, action in enumerate(actions):
        assert not info["is_success"].any() and "final_info" not in info
        seen, reward, terminated, truncated, info = envs.step(np.stack([action, 0 * action]))
        assert reward[0] == episode.rewards[k] and not terminated.any()
    assert truncated.all() and episode.info["success"][:-1].any()
    np.testing.assert_array_equal(info["final_info"]["is_success"], [True, False])
    end = info["final_obs"][0]["environment_state"]
    assert not np.array_equal(end, seen["environment_state"][0])
    assert not info["is_success"].any() and set(info["variation"]) <= set(range(800, 1000))
    envs.close()


def test_bad_settings_are_rejected():
    for wrong in ({"task": "fold_rope"}, {"actor": "panda"}, {"settings": {"seed": 1}}):
        with pytest.raises(SoftGymError):
            Config(**wrong)


SMALL = {
    "act": "dim_model=32 n_heads=2 dim_feedforward=32 n_encoder_layers=1 use_vae=false "
    "chunk_size=4 n_action_steps=2",
    "diffusion": "down_dims=[8,16] diffusion_step_embed_dim=8 horizon=8 n_action_steps=2 "
    "num_inference_steps=2 spatial_softmax_num_keypoints=4",
}


@pytest.mark.parametrize("kind", SMALL)
def test_lerobot_trains_and_evaluates_as_softgym_mj_does(kind, home, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    dataset = record(
        ROPE, [0, 1], format="lerobot", dataset=f"mine/{kind}", horizon=9,
        observation=["proprioception", "rgb"], image_size=(48, 64),
    )  # fmt: skip
    environment = "--env.type=softgym_mj --env.image_size=[48,64] --env.episode_length=8"
    policy = [f"--policy.{setting}" for setting in SMALL[kind].split()]
    _command(
        "lerobot_train", f"--dataset.repo_id={dataset.repo_id} --policy.type={kind} {environment} "
        "--policy.push_to_hub=false --policy.device=cpu --policy.pretrained_backbone_weights=null "
        "--batch_size=2 --num_workers=0 --steps=2 --save_freq=2 --env_eval_freq=2 "
        "--eval.n_episodes=1 --output_dir=run", *policy,
    )  # fmt: skip
    trained = "run/checkpoints/last/pretrained_model"
    _command(
        "lerobot_eval", f"--policy.path={trained} --policy.device=cpu {environment} "
        "--eval.n_episodes=2 --eval.batch_size=2 --output_dir=scores",
    )  # fmt: skip
    result = json.loads((tmp_path / "scores" / "eval_info.json").read_text())["overall"]
    assert (result["n_episodes"], result["pc_success"]) == (2, 0.0)
    assert imageio.immeta(result["video_paths"][0])["fps"] == 12.5
    (tmp_path / "mine.py").write_text(
        "import functools, lerobot_env_softgym_mj as plugin\n"
        f"make = functools.partial(plugin.load_policy, {trained!r})\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "mine", raising=False)
    env = softgym_mj.load(
        ROPE, observation=["proprioception", "rgb"], image_size=(48, 64), horizon=8
    )
    once, again = (
        [play(env, "mine:make", k, camera=None).rewards.sum() for k in (800, 801)] for _ in "ab"
    )
    assert once == again
    if kind == "act":  # Diffusion samples.
        assert result["avg_sum_reward"] == pytest.approx(np.mean(once), rel=1e-5)


def _command(script, *words):
    """Runs a command of LeRobot."""
    options = [option for word in words for option in word.split()]
    subprocess.run([sys.executable, "-m", f"lerobot.scripts.{script}", *options], check=True)
