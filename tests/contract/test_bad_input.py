"""Bad input gives typed errors that say what would have worked, and changes nothing."""

import dataclasses
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

import softgym_mj
from softgym_mj import exceptions
from softgym_mj.envs.gymnasium_env import SoftGymEnv

ROPE, CLOTH = "straighten_rope", "spread_cloth"
ROPE_ID, CLOTH_ID = "softgym_mj/StraightenRope-v0", "softgym_mj/SpreadCloth-v0"


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

# Task, settings, the argument the message names, the value it repeats, choices it offers.
UNKNOWN_NAMES = [
    (ROPE, {"actor": "hand"}, "actor", "'hand'", ("'picker'",)),
    (ROPE, {"observation": "pixels"}, "observation", "'pixels'", ("'full'", "'reduced'", "'rgb'")),
    (ROPE, {"observation": ("full", "x")}, "observation", "('full', 'x')", ("'reduced'",)),
    (ROPE, {"observation": ["full", "full"]}, "observation", "['full', 'full']", ("'rgb'",)),
    (ROPE, {"observation": []}, "observation", "[]", ("'full'", "'reduced'", "'rgb'")),
    (ROPE, {"split": "test"}, "split", "'test'", ("'train'", "'evaluate'", "'all'")),
    (ROPE, {"fidelity": "ultra"}, "fidelity", "'ultra'", ("'fast'", "'default'", "'accurate'")),
    (CLOTH, {"fidelity": "ultra"}, "fidelity", "'ultra'", ("'fast'", "'default'", "'accurate'")),
    (CLOTH, {"actor": "Picker"}, "actor", "'Picker'", ("'picker'",)),
    (CLOTH, {"observation": "lidar"}, "observation", "'lidar'", ("'full'", "'reduced'", "'rgb'")),
]
OUT_OF_RANGE = [
    (ROPE, {"horizon": 0}, "horizon", "0", ("1 or more",)),
    (ROPE, {"horizon": -5}, "horizon", "-5", ("1 or more",)),
    (ROPE, {"num_pickers": 0}, "num_pickers", "0", ("1 or more",)),
    (ROPE, {"num_pickers": -1}, "num_pickers", "-1", ("1 or more",)),
    (ROPE, {"image_size": (0, 64)}, "image_size", "(0, 64)", ("1..1280",)),
    (ROPE, {"image_size": (64, 0)}, "image_size", "(64, 0)", ("1..1280",)),
    (ROPE, {"image_size": (64, 1281)}, "image_size", "(64, 1281)", ("1..1280",)),
    (ROPE, {"split": []}, "split", "[]", ("at least one variation",)),
    (ROPE, {"split": [0, 1000]}, "variation", "1000", ("0..999",)),
    (ROPE, {"split": [-1]}, "variation", "-1", ("0..999",)),
    (ROPE, {"split": ["train"]}, "variation", "'train'", ("0..999",)),
    (ROPE, {"action_repeat": 0}, "action_repeat", "0", ("1 or more",)),
    (ROPE, {"action_repeat": -1}, "action_repeat", "-1", ("1 or more",)),
    (CLOTH, {"horizon": 0}, "horizon", "0", ("1 or more",)),
    (CLOTH, {"num_pickers": 0}, "num_pickers", "0", ("1 or more",)),
    (CLOTH, {"image_size": (0, 0)}, "image_size", "(0, 0)", ("1..1280",)),
]
# Values of a wrong type: the message must still name argument and value.
WRONG_TYPES = [
    (ROPE, {"image_size": 0}, "image_size", "0"),
    (ROPE, {"image_size": 64}, "image_size", "64"),
    (ROPE, {"image_size": (64,)}, "image_size", "(64,)"),
    (ROPE, {"image_size": ("64", "64")}, "image_size", "('64', '64')"),
    (ROPE, {"observation": None}, "observation", "None"),
    (ROPE, {"observation": 3}, "observation", "3"),
    (ROPE, {"split": None}, "split", "None"),
    (ROPE, {"split": 800}, "split", "800"),
    (ROPE, {"horizon": "75"}, "horizon", "'75'"),
    (ROPE, {"horizon": 2.5}, "horizon", "2.5"),
    (ROPE, {"num_pickers": 1.5}, "num_pickers", "1.5"),
    (ROPE, {"num_pickers": "2"}, "num_pickers", "'2'"),
    (ROPE, {"action_repeat": 1.5}, "action_repeat", "1.5"),
]


def each(arguments: str, table: list[tuple]):
    """Parametrizes with the rows of a table named by task and settings."""
    ids = [
        " ".join([row[0], *(f"{name}={value!r}" for name, value in row[1].items())])
        for row in table
    ]
    return pytest.mark.parametrize(arguments, table, ids=ids)


@pytest.fixture(name="build", params=["load", "gymnasium"])
def _build(request):
    """Builds a task by `softgym_mj.load` or by `gymnasium.make`."""
    if request.param == "load":
        return softgym_mj.load
    return lambda task, **settings: make(softgym_mj.TASKS[task].gymnasium_id, **settings)


@each("task, settings, argument, value, choices", UNKNOWN_NAMES)
def test_unknown_name(build, task, settings, argument, value, choices):
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        build(task, **settings)
    assert_says(error, f"{argument}={value}", *choices)


@pytest.mark.parametrize(
    ("argument", "choices"),
    [("number_of_pickers", ("'num_pickers'",)), ("sizes", ("'actor'", "'observation'"))],
)
def test_unexpected_argument(build, argument, choices):
    with pytest.raises(exceptions.UnexpectedArgumentError) as error:
        build(ROPE, **{argument: 2})
    assert isinstance(error.value, TypeError)
    for word in (f"{ROPE} got an unexpected keyword argument '{argument}'", *choices):
        assert word in str(error.value)


@pytest.mark.parametrize(
    ("build", "function"),
    [
        (softgym_mj.load, softgym_mj.load),
        (
            lambda task, **settings: make(softgym_mj.TASKS[task].gymnasium_id, **settings),
            SoftGymEnv,
        ),
    ],
    ids=["load", "gymnasium"],
)
def test_an_unexpected_argument_lists_every_argument(build, function):
    with pytest.raises(exceptions.UnexpectedArgumentError) as error:
        build(ROPE, colour=2)
    own = [parameter.name for parameter in inspect.signature(function).parameters.values()
           if parameter.kind is not parameter.VAR_KEYWORD and parameter.name != "task"]  # fmt: skip
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


@each("task, settings, argument, value, choices", OUT_OF_RANGE)
def test_out_of_range(build, task, settings, argument, value, choices):
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        build(task, **settings)
    assert_says(error, f"{argument}={value}", *choices)


@pytest.mark.parametrize("seed", ["a", -1, 2**32, 0.5])
def test_bad_random_state(seed):
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        softgym_mj.load(ROPE, random_state=seed)
    assert_says(error, f"random_state={seed!r}", "0..4294967295")


def test_cache_that_cannot_be_written(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("SOFTGYM_MJ_CACHE", str(tmp_path / "file" / "below"))
    env = softgym_mj.load(ROPE, fidelity="fast")
    with pytest.raises(exceptions.StoreError) as error:
        env.reset(3)
    assert isinstance(error.value, OSError)
    for word in (str(tmp_path), "SOFTGYM_MJ_CACHE"):
        assert word in str(error.value)


@each("task, settings, argument, value", WRONG_TYPES)
def test_wrong_type(task, settings, argument, value):
    with pytest.raises(exceptions.SoftGymError) as error:
        softgym_mj.load(task, **settings)
    assert_says(error, f"{argument}={value}")


@pytest.mark.parametrize("task", ["RopeFlatten", "Straighten_Rope", "", None, ["spread_cloth"]])
def test_unknown_task(task):
    for build in (softgym_mj.load, SoftGymEnv):
        with pytest.raises(exceptions.InvalidArgumentError) as error:
            build(task)
        assert_says(error, f"task={task!r}", "'straighten_rope'", "'spread_cloth'")


@pytest.mark.parametrize("identifier", [ROPE_ID, CLOTH_ID])
@pytest.mark.parametrize(
    ("argument", "value", "choices"),
    [
        ("render_mode", "depth", ("None", "'rgb_array'", "'depth_array'")),
        ("camera", "front", ("'task'", "'overview'")),
    ],
)
@pytest.mark.filterwarnings("ignore:.*render_modes")
def test_unknown_render_setting(identifier, argument, value, choices):
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        make(identifier, **{argument: value})
    assert_says(error, f"{argument}={value!r}", *choices)


@pytest.mark.parametrize("size", [(0, 10), (10, 0), 0, (10,)], ids=str)
def test_bad_render_size(size):
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        make(ROPE_ID, render_mode="rgb_array", render_size=size)
    assert_says(error, f"render_size={size!r}")


# ---------------------------------------------------------------- reset


@pytest.fixture(name="env")
def _env():
    env = softgym_mj.load(ROPE, split=[3], horizon=5, random_state=0)
    env.reset()
    return env


@pytest.mark.parametrize("variation", [-1, 1000, 3.5, True, "3"])
def test_bad_variation(env, variation):
    before = env.get_state()
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        env.reset(variation)
    assert_says(error, f"variation={variation!r}", "0..999")
    assert_same_state(env.get_state(), before)
    gym = make(ROPE_ID)
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        gym.reset(options={"variation": variation})
    assert_says(error, f"variation={variation!r}", "0..999")


@pytest.mark.parametrize("option", ["index", "Variation", ""])
def test_unknown_reset_option(option):
    gym = make(ROPE_ID)
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        gym.reset(options={option: 3})
    assert_says(error, f"options key={option!r}", "'variation'")


# ---------------------------------------------------------------- actions

BAD_ACTIONS = {
    "nan": [0, 0, np.nan, 0, 0, 0, 0, 0],
    "all nan": np.full(8, np.nan),
    "inf": [0, np.inf, 0, 0, 0, 0, 0, 0],
    "-inf": [0, 0, 0, 0, 0, 0, 0, -np.inf],
    "1.5": [0, 0, 0, 1.5, 0, 0, 0, 0],
    "-2": [-2, 0, 0, 0, 0, 0, 0, 0],
    "just above": [0, 0, 0, 0, 0, 0, 0, 1.0001],
    "float32 above": np.full(8, 1.001, np.float32),
    "huge": np.full(8, 1e300),
    "too few": np.zeros(7),
    "too many": np.zeros(9),
    "one picker": np.zeros(4),
    "empty": [],
    "scalar": 0.0,
    "row": np.zeros((1, 8)),
    "column": np.zeros((8, 1)),
    "matrix": np.zeros((2, 4)),
    "ragged": [[0, 0, 0, 0], [0, 0, 0]],
    "text": "up",
    "texts": ["a"] * 8,
    "numbers as text": ["0"] * 8,
    "array of text": np.array(["0.5"] * 8),
    "bytes": b"12345678",
    "none": None,
    "nones": [None] * 8,
    "dictionary": {"dx": 0.0},
    "object": object(),
    "complex": np.full(8, 0.1 + 0.5j),
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


each_bad_action = pytest.mark.parametrize(
    "action", list(BAD_ACTIONS.values()), ids=list(BAD_ACTIONS)
)


@each_bad_action
@pytest.mark.filterwarnings("ignore::numpy.exceptions.ComplexWarning")
def test_bad_action_changes_nothing(env, action):
    move = np.array([0.5, -0.3, -1.0, 1.0, -0.2, 0.1, -1.0, 1.0])
    env.step(move)
    before = env.get_state()
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        env.step(action)
    assert_says(error, "action")
    assert_same_state(env.get_state(), before)
    # The episode goes on as if nothing had happened.
    twin = softgym_mj.load(ROPE, split=[3], horizon=5, random_state=0)
    twin.reset()
    twin.step(move)
    for _ in range(4):
        step, expected = env.step(move), twin.step(move)
        np.testing.assert_array_equal(step.observation["reduced"], expected.observation["reduced"])
        assert step.reward == expected.reward
        assert step.last() == expected.last()
    assert step.last()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nan", ("[2]", "nan", "[-1, 1]")),
        ("1.5", ("[3]", "1.5", "[-1, 1]", "numpy.clip")),
        ("-2", ("[0]", "-2.0", "[-1, 1]")),
        ("too few", ("(7,)", "(8,)")),
        ("row", ("(1, 8)", "(8,)")),
        ("text", ("'up'",)),
    ],
)
def test_message_about_a_bad_action(env, name, words):
    with pytest.raises(exceptions.InvalidArgumentError) as error:
        env.step(BAD_ACTIONS[name])
    assert_says(error, *words)


@pytest.mark.parametrize("name", ["nan", "1.5", "too few", "text", "none"])
def test_bad_action_in_gymnasium(name):
    gym = make(ROPE_ID, split=[3], horizon=2)
    gym.reset(seed=0)
    before = gym.unwrapped.get_state()
    with pytest.raises(exceptions.InvalidArgumentError):
        gym.step(BAD_ACTIONS[name])
    assert_same_state(gym.unwrapped.get_state(), before)
    gym.step(np.zeros(8, np.float32))
    *_, truncated, _ = gym.step(np.zeros(8, np.float32))
    assert truncated


@pytest.mark.parametrize(
    "action",
    [
        np.ones(8, np.float32),
        -np.ones(8, np.float32),
        np.nextafter(np.ones(8, np.float32), np.float32(2.0)),  # Rounding of one unit.
        [1] * 8,
        (-1.0,) * 8,
        np.zeros(8, int),
    ],
)
def test_good_actions(env, action):
    start = env.task.actor.positions()
    env.step(action)
    moved = env.task.actor.positions() - start
    # 0.08 m along each axis: from 0.1 m above the floor to 0.02 m (the radius) at the lowest.
    expected = 0.08 * np.asarray(action, float).reshape(2, 4)[:, :3]
    np.testing.assert_allclose(moved, expected, atol=1e-6)


# ---------------------------------------------------------------- snapshots


def assert_refused(env, snapshot, *words: str) -> None:
    before = env.get_state()
    with pytest.raises(exceptions.SnapshotError) as error:
        env.set_state(snapshot)
    assert_says(error, *words)
    assert_same_state(env.get_state(), before)


def test_snapshot_of_another_task(env):
    cloth = softgym_mj.load(CLOTH, fidelity="fast")
    cloth.reset(0)
    assert_refused(cloth, env.get_state(), "'straighten_rope'", "'spread_cloth'")
    assert_refused(env, cloth.get_state(), "'straighten_rope'", "'spread_cloth'")


@pytest.mark.parametrize("snapshot", [None, 3, {"task_name": ROPE}], ids=str)
def test_no_snapshot_at_all(env, snapshot):
    assert_refused(env, snapshot, "get_state", repr(snapshot))


@pytest.mark.parametrize("variation", [3, 4])
def test_snapshot_of_another_number_of_pickers(env, variation):
    other = softgym_mj.load(ROPE, num_pickers=1)
    other.reset(variation)
    assert_refused(env, other.get_state(), "action size=4 against 8")
    assert_refused(other, env.get_state(), "action size=8 against 4")


def test_snapshot_of_another_fidelity():
    fast, default = (softgym_mj.load(CLOTH, fidelity=name) for name in ("fast", "default"))
    for each in (fast, default):
        each.reset(0)
    assert_refused(fast, default.get_state(), "fidelity")


def test_no_snapshot_before_the_first_reset():
    for fresh in (softgym_mj.load(ROPE), make(ROPE_ID).unwrapped):
        with pytest.raises(exceptions.LifecycleError, match="no episode has started"):
            fresh.get_state()


def test_snapshot_in_gymnasium():
    gym, other = make(ROPE_ID, num_pickers=3), make(ROPE_ID)
    for each_gym in (gym, other):
        each_gym.reset(options={"variation": 3})
    before = other.unwrapped.get_state()
    with pytest.raises(exceptions.SnapshotError):
        other.unwrapped.set_state(gym.unwrapped.get_state())
    assert_same_state(other.unwrapped.get_state(), before)


# ---------------------------------------------------------------- order of calls


def test_info_before_reset():
    with pytest.raises(exceptions.LifecycleError, match=r"reset\(\)"):
        softgym_mj.load(ROPE).info()


def test_step_before_reset():
    gym = make(ROPE_ID)
    with pytest.raises(exceptions.LifecycleError, match=r"reset\(\)") as error:
        gym.unwrapped.step(np.zeros(8))
    assert isinstance(error.value, RuntimeError)


def test_step_after_truncation():
    gym = make(ROPE_ID, horizon=2)
    for _ in range(2):
        gym.reset(options={"variation": 3})
        gym.step(np.zeros(8))
        *_, terminated, truncated, _ = gym.step(np.zeros(8))
        assert truncated and not terminated
        with pytest.raises(exceptions.LifecycleError, match=r"reset\(\)"):
            gym.step(np.zeros(8))


def test_failed_reset_does_not_start_an_episode():
    gym = make(ROPE_ID)
    with pytest.raises(exceptions.InvalidArgumentError):
        gym.unwrapped.reset(options={"variation": 1000})
    with pytest.raises(exceptions.LifecycleError):
        gym.unwrapped.step(np.zeros(8))


@pytest.mark.parametrize(
    "use",
    [
        lambda gym, _: gym.reset(),
        lambda gym, _: gym.step(np.zeros(8)),
        lambda gym, _: gym.render(),
        lambda gym, _: gym.get_state(),
        lambda gym, state: gym.set_state(state),
    ],
    ids=["reset", "step", "render", "get_state", "set_state"],
)
def test_use_after_close(use):
    gym = make(ROPE_ID).unwrapped
    gym.reset(options={"variation": 3})
    state = gym.get_state()
    gym.close()
    with pytest.raises(exceptions.LifecycleError, match="closed: make a new one"):
        use(gym, state)
    gym.close()


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
        assert re.search(r"apt-get install -y .*libegl1", line)
        assert "MUJOCO_GL='disable'" in line
    assert lines[3] == "goes on"


SLOW_MODULES = ("torch", "mink", "matplotlib", "dm_control", "OpenGL", "glfw")


@pytest.mark.parametrize("backend", [None, "egl", "disable"])
def test_import_stays_cheap(backend):
    code = "import softgym_mj, sys; print(*{name.split('.')[0] for name in sys.modules})"
    imported = run(code, MUJOCO_GL=backend, DISPLAY=None, WAYLAND_DISPLAY=None).split()
    assert "softgym_mj" in imported
    assert sorted(set(SLOW_MODULES) & set(imported)) == []


@pytest.mark.parametrize(
    "imports",
    [
        "import softgym_mj; from dm_control import suite",
        "from dm_control import suite; import softgym_mj",
        "import dm_control; import softgym_mj; import dm_control.suite as suite",
    ],
)
def test_suite_domain(imports):
    code = f"""
{imports}
print("softgym" in suite._DOMAINS)
print(type(suite.load("softgym", "straighten_rope", {{"random": 3}})).__module__)
print(suite.load("cartpole", "balance").action_spec().shape)
"""
    lines = run(code, MUJOCO_GL="disable").splitlines()
    assert lines[0] == "True"
    assert lines[1] == "softgym_mj.envs.environment"
    assert lines[2] == "(1,)"
