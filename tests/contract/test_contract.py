"""Every task keeps the same contract, whatever its observation."""

import dm_env
import gymnasium
import numpy as np
import pytest
from dm_control import suite
from gymnasium.utils.env_checker import check_env

import softgym_mj
from softgym_mj.entities.views import VIEWS
from softgym_mj.registry import SUITES
from softgym_mj.tasks.shared.observations import OBSERVATIONS

# Fast objects keep the contract tests short; the contract does not depend on the resolution.
SETTINGS: dict[str, dict] = {
    name: {} if "rope" in record.tags else {"fidelity": "fast"}
    for name, record in softgym_mj.TASKS.items()
}
FLEX_TASKS = [name for name, record in softgym_mj.TASKS.items() if "water" not in record.tags]
# A case is a task with its usual actor, or "task/actor".
CASES = [
    *softgym_mj.TASKS,
    *(f"{task}/pick_and_place" for task in FLEX_TASKS),
    "spread_cloth/pixel_pick_and_place",
    "straighten_rope/pixel_pick_and_place",
]
# Two pickers x 4; dx; dx, dz, dtheta.
ACTION_SIZES = {task: 8 for task in FLEX_TASKS} | {
    "transport_water": 1, "pour_water": 3, "pour_water_amount": 3,
    "spread_cloth/pixel_pick_and_place": 5, "straighten_rope/pixel_pick_and_place": 5,
}  # fmt: skip
# One of each kind of object and actor, for what is the same code in every task.
FEW = ("straighten_rope", "pour_water", "spread_cloth/pick_and_place")
VARIATION = 800


def parametrized(usual):
    """With all cases; only the usual ones run by default."""
    marks = {case: () if case in usual else pytest.mark.slow for case in CASES}
    return pytest.mark.parametrize(
        "case", [pytest.param(case, marks=marks[case]) for case in CASES]
    )


few_cases = parametrized(FEW)


def make(case, **kwargs):
    task, *actor = case.split("/")
    settings = {"split": "evaluate", **SETTINGS[task], **({"actor": actor[0]} if actor else {})}
    return softgym_mj.load(task, **{**settings, **kwargs})


def actions(env, count, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (count, *env.action_spec().shape))


@parametrized((*softgym_mj.TASKS, *FEW, "straighten_rope/pixel_pick_and_place"))
def test_specs_match_what_is_returned(case):
    """Observations share no memory either, and rewards are the sum of the terms in info."""
    env = make(case, observation=list(OBSERVATIONS), image_size=(48, 64))
    timestep = env.reset(VARIATION)
    steps = [timestep]
    kept = {name: value.copy() for name, value in timestep.observation.items()}
    for act in actions(env, 3):
        steps.append(env.step(act))
        info = env.info()
        terms = [value for key, value in info.items() if key.startswith("reward_")]
        guide = info.get("reward_approach", 0.0)  # Some rewards lead to the goal from far away.
        assert terms and steps[-1].reward == sum(terms) == info["performance"] + guide
        assert all(isinstance(value, np.generic) for value in info.values())
    for step in steps:
        assert set(step.observation) == set(OBSERVATIONS) == set(env.observation_spec())
        for name, spec in env.observation_spec().items():
            spec.validate(step.observation[name])
            assert np.isfinite(step.observation[name]).all()
    for name, value in timestep.observation.items():
        assert not np.shares_memory(value, steps[1].observation[name])
        np.testing.assert_array_equal(value, kept[name])
    assert steps[0].observation["rgb"].shape == (48, 64, 3)
    assert steps[0].observation["rgb"].dtype == np.uint8
    assert all(isinstance(step.reward, float) for step in steps[1:])
    assert all(step.discount == 1.0 for step in steps[1:])
    spec = env.action_spec()
    assert (spec.minimum == -1).all() and (spec.maximum == 1).all()
    task = case.split("/")[0]
    assert spec.shape == (ACTION_SIZES.get(case, ACTION_SIZES[task]),)


@pytest.mark.parametrize("task", ["spread_cloth", "straighten_rope"])
def test_reduced_and_full_states_list_what_they_say(task):
    env = make(task, observation=["full", "reduced"])
    observation = env.reset(VARIATION).observation
    vertices = env.task.objects[0].points()
    pickers = env.task.actor.positions()
    full = observation["full"]
    np.testing.assert_array_equal(full[: vertices.size], vertices.ravel())
    assert not full[vertices.size : -6].any()
    np.testing.assert_array_equal(full[-6:], pickers.ravel())
    # Hand-written key points: cloth corners p1..p4; ten evenly spaced rope vertices.
    if task == "spread_cloth":
        rows, columns = env.task.cloth.shape
        keys = [0, (rows - 1) * columns, columns - 1, rows * columns - 1]
        assert full.size == 3 * 19 * 19 + 6  # 118 * 0.00625 m in steps of 0.04 m: 19 a side.
    else:
        keys = [0, 4, 9, 13, 18, 22, 27, 31, 36, 40]
        assert full.size == 3 * 41 + 6
    expected = np.concatenate([vertices[keys].ravel(), pickers.ravel()])
    np.testing.assert_array_equal(observation["reduced"], expected)


@few_cases  # Golden episodes have all of them.
def test_same_seed_and_actions_give_the_same_bits(case):
    runs = []
    for seed in (3, 3, 4):
        env = make(case, random_state=seed)
        steps = [env.reset()] + [env.step(action) for action in actions(env, 2)]
        runs.append((env.task.variation, [s.observation["reduced"] for s in steps], steps[-1]))
    assert runs[0][0] == runs[1][0] != runs[2][0]
    np.testing.assert_array_equal(runs[0][1], runs[1][1])
    assert runs[0][2].reward == runs[1][2].reward
    assert not np.array_equal(runs[0][1][0], runs[2][1][0])


@pytest.mark.parametrize("task", ["straighten_rope", "pour_water"])
def test_the_episode_ends_at_the_horizon_and_restarts(task):
    env = make(task, horizon=2)
    record = softgym_mj.TASKS[task]
    assert make(task).horizon == record.horizon
    assert env.control_timestep() == pytest.approx(0.01 * record.action_repeat)
    first = env.reset(VARIATION)
    act = actions(env, 3)
    steps = [env.step(action) for action in act]
    types = [step.step_type for step in (first, *steps)]
    assert types == [
        dm_env.StepType.FIRST, dm_env.StepType.MID, dm_env.StepType.LAST, dm_env.StepType.FIRST
    ]  # fmt: skip
    assert steps[1].discount == 1.0  # A time limit is not a terminal state.
    assert env.task.variation in range(800, 1000)


def test_dm_control_suite_loads_the_tasks():
    listed = [name for domain in SUITES for name in suite._DOMAINS[domain].SUITE]
    assert set(listed) >= set(softgym_mj.TASKS)
    env = suite.load("softgym", "spread_cloth", {"split": [801], "random": 1, "fidelity": "fast"})
    env.reset()
    assert env.task.variation == 801
    assert env.physics.model.ncam >= 2
    assert suite.load("cartpole", "balance").action_spec().shape == (1,)


@few_cases
def test_gymnasium_check_env(case):
    task, *actor = case.split("/")
    env = gymnasium.make(
        softgym_mj.TASKS[task].gymnasium_id,
        render_mode="rgb_array",
        render_size=(64, 64),
        split=[800, 801],
        **SETTINGS[task],
        **({"actor": actor[0]} if actor else {}),
    )
    # Pictures do not depend on who acts: they are checked with the usual actor.
    check_env(env.unwrapped, skip_render_check=bool(actor))


@pytest.mark.parametrize("observation", ["reduced", "rgb", list(OBSERVATIONS)])
def test_gymnasium_spaces_and_dtypes(observation):
    env = gymnasium.make(
        "softgym_mj/StraightenRope-v0", observation=observation, image_size=(32, 32)
    )
    value, info = env.reset(options={"variation": 812})
    assert info["variation"] == 812
    assert env.observation_space.contains(value)
    parts = value.values() if isinstance(value, dict) else [value]
    assert {part.dtype.name for part in parts} <= {"float32", "uint8"}
    _, reward, terminated, truncated, _ = env.step(env.action_space.sample())
    assert isinstance(reward, float) and terminated is False and truncated is False


def test_gymnasium_renders_metric_depth():
    """Pictures are checked by Gymnasium's `check_env`."""
    env = gymnasium.make(
        "softgym_mj/StraightenRope-v0",
        render_mode="depth_array",
        render_size=(120, 160),
        split=[800],
    )
    env.reset()
    depth = env.render()
    assert depth.shape == (120, 160) and depth.dtype == np.float32
    # In the middle of the image is the point of the floor that the camera looks at.
    pose = VIEWS["straighten_rope"].camera
    down = 1 - 2 * (pose.quaternion[1] ** 2 + pose.quaternion[2] ** 2)  # Z of the axis.
    assert np.median(depth[58:62, 78:82]) == pytest.approx(pose.position[2] / down, rel=0.05)
    assert 0.3 < depth.min() < np.median(depth)


@pytest.mark.parametrize(
    ("task", "other_size"),
    [("spread_cloth", True), ("pour_water", True), ("straighten_rope", False)],
)
def test_recompiles_only_when_the_size_changes(task, other_size):
    env = make(task)
    env.reset(800)
    model = env.physics.model.ptr
    env.reset(800)
    assert env.physics.model.ptr is model
    env.reset(801)
    assert (env.physics.model.ptr is not model) == other_size
