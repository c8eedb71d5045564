"""Bad input raises typed errors that name valid values, and changes nothing."""

import ctypes
import dataclasses
import functools
import inspect
import os
import pathlib
import pickle
import re
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
import torch

import softgym_mj
from softgym_mj import exceptions
from softgym_mj.envs.gymnasium_env import SoftGymEnv
from softgym_mj.recording import record

ROPE, CLOTH, WATER = "straighten_rope", "spread_cloth", "pour_water"
ROPE_ID = "softgym_mj/StraightenRope-v0"
GIVEN = {"task", "num_envs", "variations"}  # Arguments that callers must give.


def assert_says(error: pytest.ExceptionInfo, *words: str) -> None:
    """The error belongs to the package's tree, is a ValueError and its message has all words."""
    assert isinstance(error.value, exceptions.SoftGymError)
    assert isinstance(error.value, ValueError)
    for word in words:
        assert word in str(error.value)


def make(identifier: str, **settings) -> gymnasium.Env:
    # The checker's own asserts would come first.
    return gymnasium.make(identifier, disable_env_checker=True, **settings)


# ---------------------------------------------------------------- settings

# Task, settings, what the message says of them, choices it offers.
BAD_SETTINGS = [
    (ROPE, {"actor": "hand"}, "actor='hand'", "'picker'"),
    (ROPE, {"observation": "pixels"}, "observation='pixels'", "'full'", "'reduced'", "'rgb'"),
    (ROPE, {"observation": ("full", "x")}, "observation='x' is unknown", "'reduced'"),
    (ROPE, {"observation": ["full", "full"]}, "observation=['full', 'full']", "different", "'rgb'"),
    (ROPE, {"observation": []}, "observation=[]", "one or more", "'full'", "'reduced'", "'rgb'"),
    (ROPE, {"observation": None}, "observation=None"),
    (ROPE, {"fidelity": "ultra"}, "fidelity='ultra'", "'fast'", "'default'", "'accurate'"),
    (CLOTH, {"fidelity": "ultra"}, "fidelity='ultra'", "'fast'", "'default'", "'accurate'"),
    (WATER, {"fidelity": "ultra"}, "fidelity='ultra'", "'fast'", "'default'", "'accurate'"),
    (WATER, {"actor": "picker"}, "PourWater has no actor='picker'; valid choices: 'cup', 'franka'"),
    ("hang_cloth", {"actor": "cup"}, "HangCloth has no actor='cup'; valid choices: 'picker'"),
    (ROPE, {"observation": "wrist_rgb"}, "'wrist_rgb' needs an arm: actor='franka', 'sawyer'"),
    (WATER, {"observation": ["rgb", "held"]}, "observation=['rgb', 'held']: 'held' needs grippers"),
    (CLOTH, {"observation": "goal_rgb"}, "'goal_rgb' needs a task", "rope_configuration"),
    (ROPE, {"split": "test"}, "split='test'", "'train'", "'evaluate'", "'all'"),
    (ROPE, {"split": []}, "split=[]", "at least one variation"),
    (ROPE, {"split": [0, 1000]}, "variation=1000", "0..999"),
    (ROPE, {"split": ["train"]}, "variation='train'", "0..999"),
    (ROPE, {"split": 800}, "split=800"),
    (ROPE, {"horizon": 0}, "horizon=0", "1 or more"),
    (ROPE, {"horizon": "75"}, "horizon='75'"),
    (ROPE, {"num_pickers": 0}, "num_pickers=0", "1..32"),
    (ROPE, {"action_repeat": 0}, "action_repeat=0", "1..1000"),
    (ROPE, {"action_repeat": 1.5}, "action_repeat=1.5"),
    (ROPE, {"image_size": (0, 64)}, "image_size=(0, 64)", "1..1280"),
    (ROPE, {"image_size": (64, 1281)}, "image_size=(64, 1281)", "1..1280"),
    (ROPE, {"image_size": 64}, "image_size=64"),
    (ROPE, {"image_size": (64,)}, "image_size=(64,)"),
    (ROPE, {"image_size": ("64", "64")}, "image_size=('64', '64')"),
    (ROPE, {"random_state": "a"}, "random_state='a'", "0..4294967295"),
    (ROPE, {"random_state": 2**32}, "random_state=4294967296", "0..4294967295"),
    ("RopeFlatten", {}, "task='RopeFlatten' is SoftGym's name of the task 'straighten_rope'"),
    ("ClothFoldDrop", {}, "task='ClothFoldDrop' is SoftGym's name of the task 'drop_fold_cloth'"),
    ("rope", {}, "task='rope' is unknown", "'straighten_rope'", "'spread_cloth'"),
    (None, {}, "task=None", "'straighten_rope'"),
    (["spread_cloth"], {}, "task=['spread_cloth']", "'straighten_rope'"),
]


@pytest.mark.parametrize("row", BAD_SETTINGS, ids=lambda row: row[2])
def test_bad_setting(row):
    task, settings, *words = row
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        softgym_mj.load(task, **settings)
    assert_says(error, *words)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"actor": "hand"}, ("actor='hand'", "'picker'")),
        ({"horizon": 0}, ("horizon=0", "1 or more")),
        ({"render_mode": "depth"}, ("render_mode='depth'", "'rgb_array'", "'depth_array'")),
        ({"camera": "front"}, ("camera='front'", "'task'", "'overview'")),
        ({"render_size": (10, 0)}, ("render_size=(10, 0)", "1..1280")),
    ],
)
@pytest.mark.filterwarnings("ignore:.*render_modes")
def test_bad_setting_in_gymnasium(settings, words):
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        make(ROPE_ID, **settings)
    assert_says(error, *words)


@pytest.mark.parametrize(
    ("build", "functions"),
    [
        (lambda **settings: softgym_mj.load(ROPE, **settings), [softgym_mj.load]),
        (lambda **settings: make(ROPE_ID, **settings), [SoftGymEnv]),
        (functools.partial(softgym_mj.make_vec, ROPE, 2), [SoftGymEnv, softgym_mj.make_vec]),
        (functools.partial(record, ROPE, [0]), [SoftGymEnv, record]),
    ],
    ids=["load", "gymnasium", "make_vec", "record"],
)
def test_an_unexpected_argument_lists_every_argument(build, functions):
    message = f"{ROPE} got an unexpected keyword argument 'number_of_pickers'"
    with pytest.raises(exceptions.UnexpectedArgumentError, match=message) as error:
        build(number_of_pickers=2)
    assert isinstance(error.value, TypeError)
    signatures = [inspect.signature(function).parameters.values() for function in functions]
    own = {parameter.name for parameters in signatures for parameter in parameters
           if parameter.kind is not parameter.VAR_KEYWORD} - GIVEN  # fmt: skip
    listed = re.findall(r"'(\w+)'", str(error.value).split("valid choices: ")[1].split(".")[0])
    assert sorted(listed) == sorted([*softgym_mj.TASKS[ROPE].arguments, *own])


@pytest.mark.parametrize(
    "raised",
    [
        exceptions.InvalidArgumentError("actor", "hand", {"picker": 1}.keys()),
        exceptions.InvalidArgumentError("horizon", 0, "1 or more"),
        exceptions.UnexpectedArgumentError("an unexpected keyword argument"),
    ],
    ids=lambda raised: type(raised).__name__,
)
def test_errors_travel_between_processes(raised):
    received = pickle.loads(pickle.dumps(raised))
    assert type(received) is type(raised) and str(received) == str(raised)


def test_cache_that_cannot_be_written(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(tmp_path / "file" / "below"))
    env = softgym_mj.load(ROPE, fidelity="fast")
    with pytest.raises(exceptions.StoreError) as error:
        env.reset(3)
    assert isinstance(error.value, OSError)
    for word in (str(tmp_path), "SOFTGYM_MJ_CACHE"):
        assert word in str(error.value)


# ---------------------------------------------------------------- reset and actions

MOVE = np.array([0.5, -0.3, -1.0, 1.0, -0.2, 0.1, -1.0, 1.0])


@pytest.fixture(name="rope", scope="module")
def _rope():
    return softgym_mj.load(ROPE, split=[3], horizon=5, random_state=0)


@pytest.fixture(name="env")
def _env(rope):
    """One step into an episode."""
    rope.reset(3)
    rope.step(MOVE)
    return rope


@pytest.fixture(name="expected", scope="module")
def _expected():
    """The rest of this episode, in an instance that gets no bad input."""
    twin = softgym_mj.load(ROPE, split=[3], horizon=5, random_state=0)
    twin.reset(3)
    return [twin.step(MOVE) for _ in range(5)][1:]


@pytest.mark.parametrize("variation", [-1, 1000, 3.5, True, "3"])
def test_bad_variation(env, variation):
    before = env.get_state()
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        env.reset(variation)
    assert_says(error, f"variation={variation!r}", "0..999")
    assert_same_state(env.get_state(), before)


class Raises:
    """What fails when NumPy makes an array of it."""

    def __array__(self, *args, **kwargs):
        raise KeyError("own")


# Actions and what the message says of them.
BAD_ACTIONS = {
    "nan": ([0, 0, np.nan, 0, 0, 0, 0, 0], "[2]", "nan", "[-1, 1]", "does not remove"),
    "inf": ([0, np.inf, 0, 0, 0, 0, 0, 0],),
    "1.5": ([0, 0, 0, 1.5, 0, 0, 0, 0], "[3]", "1.5", "[-1, 1]", "numpy.clip"),
    "-2": ([-2, 0, 0, 0, 0, 0, 0, 0], "[0]", "-2.0", "[-1, 1]"),
    "just above": ([0, 0, 0, 0, 0, 0, 0, 1.0001],),
    "float32 above": (np.full(8, 1.001, np.float32),),
    "huge": (np.full(8, 1e300),),
    "too few": (np.zeros(7), "(7,)", "(8,)"),
    "empty": ([],),
    "scalar": (0.0,),
    "row": (np.zeros((1, 8)), "(1, 8)", "(8,)"),
    "matrix": (np.zeros((2, 4)),),
    "ragged": ([[0, 0, 0, 0], [0, 0, 0]],),
    "text": ("up", "'up'"),
    "numbers as text": (["0"] * 8,),
    "bytes": (b"12345678",),
    "none": (None,),
    "nones": ([None] * 8,),
    "dictionary": ({"dx": 0.0},),
    "object": (object(),),
    "complex": (np.full(8, 0.1 + 0.5j),),
    "gradients": (torch.zeros(8, requires_grad=True), "Tensor", "detach()"),
    "bfloat16": (torch.zeros(8, dtype=torch.bfloat16), "Tensor", "BFloat16"),
    "sparse": (torch.zeros(8).to_sparse(), "Tensor"),
    "raises": (Raises(), "Raises", "own"),
}


def leaves(value, path: str = "") -> dict[str, object]:
    """The parts of a nested structure, arrays as type, shape and bytes."""
    if dataclasses.is_dataclass(value):
        value = dataclasses.asdict(value)
    if isinstance(value, (tuple, list)):
        value = dict(enumerate(value))
    if isinstance(value, dict):
        return {k: v for name in value for k, v in leaves(value[name], f"{path}/{name}").items()}
    if isinstance(value, np.ndarray):
        value = (str(value.dtype), value.shape, value.tobytes())
    return {path: value}


def assert_same_state(found, expected) -> None:
    """Two snapshots are bit-identical."""
    found, expected = leaves(found), leaves(expected)
    assert found.keys() == expected.keys()
    assert [name for name in found if found[name] != expected[name]] == []


@pytest.mark.parametrize("name", BAD_ACTIONS)
@pytest.mark.filterwarnings("ignore::numpy.exceptions.ComplexWarning")
def test_bad_action_changes_nothing(env, expected, name):
    action, *words = BAD_ACTIONS[name]
    before = env.get_state()
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        env.step(action)
    assert_says(error, "action", *words)
    assert_same_state(env.get_state(), before)
    # The episode goes on as if nothing had happened.
    for other in expected:
        step = env.step(MOVE)
        np.testing.assert_array_equal(step.observation["reduced"], other.observation["reduced"])
        assert step.reward == other.reward
        assert step.last() == other.last()
    assert step.last()


@pytest.mark.parametrize(
    "action",
    [
        np.ones(8, np.float32),
        -np.ones(8, np.float32),
        np.nextafter(np.ones(8, np.float32), np.float32(2.0)),  # Rounding of one unit.
        [1] * 8,
        (-1.0,) * 8,
        np.zeros(8, int),
        torch.ones(8),
    ],
)
def test_good_actions(rope, action):
    rope.reset(3)
    start = rope.task.actor.positions()
    rope.step(action)
    moved = rope.task.actor.positions() - start
    # 0.08 m along each axis: from 0.1 m above the floor to 0.02 m (the radius) at the lowest.
    expected = 0.08 * np.asarray(action, float).reshape(2, 4)[:, :3]
    np.testing.assert_allclose(moved, expected, atol=1e-6)


def test_bad_input_in_gymnasium_changes_nothing():
    gym = make(ROPE_ID, split=[3], horizon=2)
    gym.reset(seed=0)
    other = make(ROPE_ID, num_pickers=3).unwrapped
    other.reset(seed=1)
    before = gym.unwrapped.get_state()
    with pytest.raises(exceptions.InvalidArgumentError):
        gym.step(BAD_ACTIONS["nan"][0])
    with pytest.raises(exceptions.SnapshotError):
        gym.unwrapped.set_state(other.get_state())
    with pytest.raises(exceptions.SnapshotError, match=r"of softgym_mj.load: its `set_state`"):
        gym.unwrapped.set_state(gym.unwrapped.dm_env.get_state())
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        gym.reset(options={"index": 3})
    assert_says(error, "options key='index'", "'variation'")
    assert_same_state(gym.unwrapped.get_state(), before)
    gym.step(np.zeros(8, np.float32))
    *_, truncated, _ = gym.step(np.zeros(8, np.float32))
    assert truncated


# ---------------------------------------------------------------- snapshots


def assert_refused(env, snapshot, *words: str) -> None:
    before = env.get_state()
    with pytest.raises(exceptions.SnapshotError) as error:
        env.set_state(snapshot)
    assert_says(error, *words)
    assert_same_state(env.get_state(), before)


@pytest.mark.parametrize(
    ("task", "settings", "words", "other_words"),
    [
        (CLOTH, {"fidelity": "fast"}, ("'straighten_rope'", "'spread_cloth'"), ()),
        (ROPE, {"num_pickers": 1}, ("action size=4 against 8",), ("action size=8 against 4",)),
        (ROPE, {"fidelity": "fast"}, ("fidelity",), ()),
    ],
)
def test_snapshot_of_another_task_or_other_settings(env, task, settings, words, other_words):
    other = softgym_mj.load(task, **settings)
    other.reset(4)
    assert_refused(env, other.get_state(), *words)
    assert_refused(other, env.get_state(), *(other_words or words))


@pytest.mark.parametrize("snapshot", [None, 3, {"task_name": ROPE}], ids=str)
def test_no_snapshot_at_all(env, snapshot):
    assert_refused(env, snapshot, "get_state", repr(snapshot))


@pytest.mark.parametrize("steps", [-5, 2.5, None])
def test_a_snapshot_after_no_number_of_env_steps(env, steps):
    assert_refused(
        env, dataclasses.replace(env.get_state(), step_count=steps), f"step_count={steps}"
    )


def parts(value, path=()):
    """The places in a snapshot: fields, entries of dicts."""
    if dataclasses.is_dataclass(value):
        value = vars(value)
    if isinstance(value, dict):
        for name, part in value.items():
            yield from ((*path, name), *parts(part, (*path, name)))


def mangled(value, path, part):
    """A snapshot with something else in a place."""
    name, *rest = path
    if dataclasses.is_dataclass(value):
        return dataclasses.replace(value, **{name: mangled(getattr(value, name), rest, part)}
                                   if rest else {name: part})  # fmt: skip
    return {**value, name: mangled(value[name], rest, part) if rest else part}


JUNK = [None, -1, 1.5, "x", [], {}, {"a": 1}, np.zeros(3), np.nan, (1, 2), 10**9, object()]


@pytest.mark.parametrize(
    ("task", "settings"),
    [(ROPE, {}), (WATER, {}), ("fold_cloth", {"actor": "franka"}), (ROPE, {"num_pickers": 3})],
    ids=str,
)
def test_a_mangled_snapshot_is_refused_or_works(task, settings):
    """Any value in any place of a snapshot; a refused snapshot changes nothing."""
    env = softgym_mj.load(task, fidelity="fast", split="all", **settings)
    env.reset(3)
    action = np.zeros(env.action_spec().shape)
    env.step(action)
    snapshot = env.get_state()
    refused = 0
    for path in parts(snapshot):
        for junk in JUNK:
            try:
                env.set_state(mangled(snapshot, path, junk))
            except exceptions.SnapshotError:
                refused += 1
                assert_same_state(env.get_state(), snapshot)
            else:
                env.step(action)
                env.set_state(snapshot)
    assert refused > 9 * len(list(parts(snapshot)))


# ---------------------------------------------------------------- order of calls


def test_before_the_first_reset():
    fresh, gym = softgym_mj.load(ROPE), make(ROPE_ID).unwrapped
    for get_state in (fresh.get_state, gym.get_state):
        with pytest.raises(exceptions.LifecycleError, match="no episode has started"):
            get_state()
    with pytest.raises(exceptions.LifecycleError, match=r"reset\(\)"):
        fresh.info()
    for _ in range(2):
        with pytest.raises(exceptions.LifecycleError, match=r"reset\(\)") as error:
            gym.step(np.zeros(8))
        assert isinstance(error.value, RuntimeError)
        # A reset that fails does not start an episode.
        with pytest.raises(exceptions.InvalidArgumentError, match="variation=1000"):
            gym.reset(options={"variation": 1000})


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"options": 5}, ("options=5", "dict")),
        ({"options": [1]}, ("options=[1]", "dict")),
        ({"options": {"x": 1}}, ("options key='x'", "'variation', 'state'")),
        ({"seed": -1}, ("seed=-1", "0 or more")),
        ({"seed": 1.5}, ("seed=1.5", "0 or more")),
    ],
    ids=str,
)
@pytest.mark.parametrize("many", [False, True])
def test_bad_reset(arguments, words, many):
    made = softgym_mj.make_vec(ROPE, 2, device="host") if many else make(ROPE_ID)
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        made.reset(**arguments)
    assert_says(error, *words)
    if many and "options key" in words[0]:
        assert_says(error, "'reset_mask', 'stagger'")
    made.close()


def test_step_after_truncation():
    gym = make(ROPE_ID, horizon=2)
    for _ in range(2):
        gym.reset(options={"variation": 3})
        gym.step(np.zeros(8))
        *_, terminated, truncated, _ = gym.step(np.zeros(8))
        assert truncated and not terminated
        with pytest.raises(exceptions.LifecycleError, match=r"reset\(\)"):
            gym.step(np.zeros(8))


def are_closed(*uses):
    for use in uses:
        with pytest.raises(exceptions.LifecycleError, match="closed: make a new one"):
            use()


def test_use_after_close():
    gym = make(ROPE_ID).unwrapped
    gym.reset(options={"variation": 3})
    state = gym.get_state()
    gym.close()
    are_closed(
        gym.reset,
        lambda: gym.step(np.zeros(8)),
        gym.render,
        gym.get_state,
        lambda: gym.set_state(state),
    )
    gym.close()
    env = gym.dm_env
    are_closed(
        env.reset,
        lambda: env.step(np.zeros(8)),
        env.observation,
        env.info,
        env.get_state,
        lambda: env.set_state(state[0]),
    )
    env.close()


@pytest.mark.parametrize("device", ["cpu", "host"])
def test_use_of_many_before_the_first_reset_and_after_close(device):
    envs = softgym_mj.make_vec(ROPE, 1, device=device)
    with pytest.raises(exceptions.LifecycleError, match="call reset"):
        envs.get_state()
    envs.reset()
    states, actions = envs.get_state(), np.zeros((1, 8), np.float32)
    envs.close()
    are_closed(
        envs.reset,
        lambda: envs.step(actions),
        lambda: envs.step_async(actions),
        envs.render,
        envs.get_state,
        lambda: envs.set_state(states),
        lambda: envs.call("horizon"),
        lambda: envs.set_attr("mark", 1),
    )
    envs.close()


# ---------------------------------------------------------------- separate processes


def run(code: str, **variables: str | None) -> str:
    """Output of a fresh Python; a variable that is None is unset."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(pathlib.Path(softgym_mj.__file__).parents[1]),
        **variables,
    }
    environment = {name: value for name, value in environment.items() if value is not None}
    process = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    return process.stdout


NO_GL = """
import numpy as np, softgym_mj, gymnasium
env = softgym_mj.load("straighten_rope", split=[3], observation=("full", "reduced"))
env.reset()
print(env.step(np.zeros(8)).observation["reduced"].sum().hex())
gym = gymnasium.make(
    "softgym_mj/StraightenRope-v0", disable_env_checker=True, render_mode="rgb_array"
)
gym.reset(seed=0)
def rendered():
    return gym.render()
def observed():
    return softgym_mj.load("straighten_rope", split=[3], observation="rgb").reset()
for call in (rendered, observed):
    try:
        call()
    except softgym_mj.exceptions.UnavailableError as error:
        print(type(error).__name__, error)
gym.step(np.zeros(8))
print("goes on")
"""


def test_without_opengl():
    lines = run(NO_GL, MUJOCO_GL="disable").splitlines()
    env = softgym_mj.load(ROPE, split=[3], observation=("full", "reduced"))
    env.reset()
    assert lines[0] == env.step(np.zeros(8)).observation["reduced"].sum().hex()
    assert len(lines) == 4
    for line in lines[1:3]:
        assert line.startswith("UnavailableError")
        assert line.endswith(
            "failed with MUJOCO_GL='disable'. Unset MUJOCO_GL and start Python again."
        )
    assert lines[3] == "goes on"


@pytest.mark.parametrize(
    ("backend", "packages"),
    [("egl", "libegl1 libgl1-mesa-dri libopengl0"), ("osmesa", "libosmesa6")],
)
def test_a_missing_opengl_library_is_named(backend, packages):
    code = """
import ctypes.util
ctypes.util.find_library = lambda name: None
try:
    import softgym_mj
except ImportError as error:
    print(type(error).__name__, error)
"""
    said = run(code, MUJOCO_GL=backend)
    assert said.startswith("UnavailableError") and repr(backend) in said
    assert f"`apt-get install -y {packages}`" in said


NO_LIBOPENGL = """
import ctypes, softgym_mj
opened = ctypes.CDLL.__init__
def guarded(self, name, *args, **kwargs):
    if name and any(part in name for part in ("libOpenGL.", "libGL.", "libGLES")):
        raise OSError(name)
    opened(self, name, *args, **kwargs)
ctypes.CDLL.__init__ = guarded
try:
    softgym_mj.load("straighten_rope", split=[3], observation="rgb").reset()
except softgym_mj.exceptions.UnavailableError as error:
    print(error)
"""


def test_without_libopengl():
    assert "apt-get install -y libegl1 libgl1-mesa-dri libopengl0`" in run(
        NO_LIBOPENGL, MUJOCO_GL="egl"
    )


def test_ctrl_c_within_opengl_is_no_missing_library(monkeypatch):
    def interrupted(*_, **__):
        raise ctypes.ArgumentError("argument 1: KeyboardInterrupt: ")

    env = softgym_mj.load(ROPE, split=[3], observation="rgb")
    monkeypatch.setattr("softgym_mj.rendering.drawing.SceneCamera", interrupted)
    with pytest.raises(ctypes.ArgumentError):
        env.reset()


SLOW_MODULES = ("torch", "mink", "matplotlib", "mitsuba", "OpenGL", "glfw")


@pytest.mark.parametrize(
    ("module", "backend"), [("softgym_mj", None), ("softgym_mj.cli.commands", "egl")]
)
def test_import_stays_cheap(module, backend):
    code = f"import {module}, sys; print(*{{name.split('.')[0] for name in sys.modules}})"
    imported = run(code, MUJOCO_GL=backend, DISPLAY=None, WAYLAND_DISPLAY=None).split()
    assert "softgym_mj" in imported
    assert sorted(set(SLOW_MODULES) & set(imported)) == []
