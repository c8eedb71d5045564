"""Datasets of LeRobot: columns by hand; what LeRobot itself reads, beside Minari's."""

import pathlib
import sys

import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError, StoreError
from softgym_mj.recording import dataset_name, make_format, record, running
from softgym_mj.recording.lerobot_format import columns

ROPE = "straighten_rope"
COUNT = 3  # Env steps of the episodes by hand.


def _episode(observations, **infos):
    """Of three env steps; values count up."""
    actions = np.arange(COUNT * 8, dtype=np.float32).reshape(COUNT, 8)
    return {
        "observations": observations,
        "actions": actions,
        "rewards": np.array([-3.0, -2.0, -1.0]),
        "terminations": np.zeros(COUNT, bool),
        "truncations": np.array([False, False, True]),
        "infos": {"success": np.array([0, 0, 1, 1]), "variation": np.full(4, 7), **infos},
    }


def _over_time(*shape, kind=np.float32):
    return np.arange((COUNT + 1) * np.prod(shape)).reshape(COUNT + 1, *shape).astype(kind)


@pytest.fixture(name="actor", scope="module")
def _actor():
    return softgym_mj.load(ROPE).task.actor


def test_columns_by_hand(actor):
    own, pictures = _over_time(8), _over_time(2, 4, 6, 3, kind=np.uint8)
    observations = {
        "depth": _over_time(4, 6),
        "external_rgb": pictures,
        "held": np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.uint8),
        "proprioception": _over_time(6),
        "reduced": _over_time(36),
        "rgb": pictures[:, 1],
    }
    episode = _episode(observations, expert_action=own[:COUNT])
    result = columns(episode, tuple(observations), actor)
    holds = np.array([[0, 0], [1, 0], [1, 1]], np.float32)
    expected = {
        "observation.state": np.hstack([observations["proprioception"][:COUNT], holds]),
        "observation.environment_state": observations["reduced"][:COUNT],
        "observation.depth": observations["depth"][:COUNT],
        "observation.images.task": pictures[:COUNT, 1],
        "observation.images.left": pictures[:COUNT, 0],
        "observation.images.right": pictures[:COUNT, 1],
        "action": own[:COUNT],  # What is to be learned.
        "executed_action": episode["actions"],
        "next.reward": np.array([[-3.0], [-2.0], [-1.0]], np.float32),
        "next.done": np.array([[False], [False], [True]]),
        "next.success": np.array([[False], [True], [True]]),
        "variation": np.full((COUNT, 1), 7),
    }
    assert set(result) == set(expected)
    for key, values in expected.items():
        np.testing.assert_array_equal(result[key].values, values, strict=True)
        assert result[key].is_image == key.startswith("observation.images.")
    assert result["observation.state"].names[3] == "gripper 1 (x, y, z) [m], 0"
    assert result["observation.state"].names[6:] == ["gripper 0 holds", "gripper 1 holds"]
    ways = ("dx [m]", "dy [m]", "dz [m]", "grip")
    assert result["action"].names[:4] == [f"gripper 0, {way}" for way in ways]


def test_a_single_observation_is_the_state(actor):
    result = columns(_episode(_over_time(36)), ("reduced",), actor)
    np.testing.assert_array_equal(result["observation.state"].values, _over_time(36)[:COUNT])
    np.testing.assert_array_equal(result["action"].values, _episode(None)["actions"])
    assert "observation.environment_state" not in result and "executed_action" not in result
    pictures = _over_time(4, 6, 3, kind=np.uint8)
    for name, camera in (("rgb", "task"), ("goal_rgb", "goal"), ("mine", "mine")):
        assert f"observation.images.{camera}" in columns(_episode(pictures), (name,), actor)


def test_ids_have_two_parts():
    name = dataset_name("fold_cloth", "scripted", "franka", noise=0.05, format="lerobot")
    assert name == "softgym_mj/fold_cloth-scripted-franka-noise0-05"


# ---------------------------------------------------------------------- what LeRobot reads


@pytest.fixture(name="lerobot")
def _lerobot(tmp_path, monkeypatch):
    """LeRobot's datasets, read by PyAV: TorchCodec wants FFmpeg on the machine."""
    reason = "needs LeRobot, whose PyTorch is older than that of the tests"
    constants = pytest.importorskip("lerobot.utils.constants", reason=reason)
    datasets = pytest.importorskip("lerobot.datasets.lerobot_dataset", reason=reason)
    monkeypatch.setattr(constants, "HF_LEROBOT_HOME", tmp_path / "lerobot")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))

    def read(made, **settings):
        return datasets.LeRobotDataset(
            made.repo_id, root=made.root, video_backend="pyav", **settings
        )

    return read


@pytest.mark.parametrize(
    ("codec", "error"),  # Mean error of pixels, of 255; their number is small, chroma halved.
    [("libsvtav1", 6.0), ("h264", 6.0), ("png", 1e-4)],
)
def test_it_reads_what_minari_reads(lerobot, codec, error):
    how = {
        "observation": ["proprioception", "held", "reduced", "rgb"],
        "image_size": (64, 96),
        "horizon": 12,
        "noise": 0.05,
    }
    expected = record(ROPE, (3, 801), **how)
    result = lerobot(record(ROPE, (3, 801), format="lerobot", codec=codec, **how))
    assert (result.fps, result.num_episodes, len(result)) == (12.5, 2, 24)
    assert result.meta.info.codebase_version == "v3.0" and result.meta.robot_type == "picker"
    errors = []
    for number, episode in enumerate(expected):
        seen = episode.observations
        state = np.hstack([seen["proprioception"], seen["held"].astype(np.float32)])
        for k in range(12):
            row = result[12 * number + k]
            for key, values in (
                ("observation.state", state),
                ("observation.environment_state", seen["reduced"]),
                ("action", episode.infos["expert_action"]),
                ("executed_action", episode.actions),
            ):
                np.testing.assert_array_equal(row[key].numpy(), values[k], strict=True)
            assert row["next.reward"] == np.float32(episode.rewards[k])
            assert row["next.done"] == (k == 11)
            assert row["next.success"] == bool(episode.infos["success"][k + 1])
            assert (row["variation"], row["episode_index"]) == ((3, 801)[number], number)
            assert row["timestamp"] == np.float32(k / 12.5)
            assert row["task"] == softgym_mj.registry.TASKS[ROPE].summary
            picture = 255 * row["observation.images.task"].numpy().transpose(1, 2, 0)
            errors.append(np.abs(picture - seen["rgb"][k]).mean())
    assert max(errors) < error
    films = list(pathlib.Path(result.root).glob("videos/observation.images.task/chunk-*/*.mp4"))
    assert len(films) == (codec != "png")


def test_it_gives_chunks_of_actions(lerobot):
    made = record(ROPE, (3,), format="lerobot", horizon=6)
    result = lerobot(made, delta_timestamps={"action": [k / 12.5 for k in range(3)]})
    each = lerobot(made)
    row = result[4]
    assert row["action_is_pad"].tolist() == [False, False, True]
    np.testing.assert_array_equal(row["action"][1], each[5]["action"])


def test_who_stops_while_it_writes_plays_nothing_again(lerobot, monkeypatch, tmp_path):
    datasets = pytest.importorskip("lerobot.datasets.lerobot_dataset")
    variations, save = [], datasets.LeRobotDataset.save_episode
    original = running.played
    monkeypatch.setattr(
        running, "played", lambda *how: (variations.append(how[-1]), original(*how))[1]
    )

    def stop(writer, **settings):
        save(writer, **settings)
        if writer.num_episodes == 2:
            raise KeyboardInterrupt

    how = {"format": "lerobot", "horizon": 3, "observation": "reduced"}
    with monkeypatch.context() as patched:
        patched.setattr(datasets.LeRobotDataset, "save_episode", stop)
        with pytest.raises(KeyboardInterrupt):
            record(ROPE, range(3), **how)
    assert not list((tmp_path / "lerobot").glob("[!.]*"))
    for _ in range(2):  # The second time it is there.
        assert lerobot(record(ROPE, range(3), **how)).num_episodes == 3
    assert variations == [0, 1, 2]
    assert not list((tmp_path / "lerobot").rglob(".*"))
    with pytest.raises(StoreError, match="exists with different settings"):
        record(ROPE, range(3), **{**how, "horizon": 4})


@pytest.mark.usefixtures("lerobot")
@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"dataset": "a/b/c"}, "dataset='a/b/c' is not valid"),
        ({"observation": ["proprioception", "reduced", "full"]}, "observation=.*no more states"),
        ({"codec": "h264", "observation": "rgb", "image_size": (33, 64)}, "image_size=.33, 64."),
        ({"author": "me"}, "author"),
    ],
)
def test_what_it_cannot_keep_is_refused_before_anything_is_played(settings, message, tmp_path):
    with pytest.raises(InvalidArgumentError, match=message):
        record(ROPE, (0,), "zero", format="lerobot", on_episode=pytest.fail, **settings)
    assert not (tmp_path / "lerobot").exists()


def test_without_it_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "lerobot", None)
    monkeypatch.setitem(sys.modules, "huggingface_hub.utils", None)
    with pytest.raises(softgym_mj.exceptions.UnavailableError, match=r"'\.\[lerobot\]'"):
        make_format("lerobot").check_id("me/rope")
