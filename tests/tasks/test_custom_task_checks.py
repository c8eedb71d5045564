"""Errors of custom tasks are reported, their state is restored, replaced tasks are freed."""

from typing import Unpack

import numpy as np
import pytest
from dm_control import mjcf

import softgym_mj
from softgym_mj.entities import Cloth
from softgym_mj.envs.environment import Environment
from softgym_mj.evaluation import Configuration, Planning, evaluate
from softgym_mj.exceptions import InvalidArgumentError, SnapshotError, SoftGymError
from softgym_mj.fluid import Liquid, Resolution, Water
from softgym_mj.parallel.executors import ProcessExecutor, SerialExecutor
from softgym_mj.policies.rollouts import ExecutorRollouts
from softgym_mj.robots.picker import Picker
from softgym_mj.tasks import Measures, Task, TaskSettings, anywhere, numbers, point, points

DIMS = (12, 12)


class Counting(Task):
    """A small cloth; the reward is the number of env steps, which the task counts itself."""

    def __init__(self, height: float = 0.1, objects=None, **settings: Unpack[TaskSettings]):
        self.cloth, self.height, self.count = Cloth(dims=DIMS), height, 0
        super().__init__([self.cloth] if objects is None else objects, **settings)

    def arrange(self, random):
        self.count = 0
        self.cloth.set_points(self.cloth.flat() + [0.0, 0.0, self.height])

    def measure(self, state, episode):
        return Measures(0.1 * self.count, {"count": float(self.count)})

    def after_step(self, physics, random_state):
        self.count += 1
        super().after_step(physics, random_state)

    def get_state(self):
        return {**super().get_state(), "count": self.count}

    def set_state(self, state):
        self.count = state["count"]
        super().set_state(state)


def started(task):
    """An environment of a task after one env step."""
    env = Environment(task, name="own", horizon=5)
    env.reset(800)
    env.step(np.zeros(env.task.actor.action_size))
    return env


# ------------------------------------------------------------------ wrong return values


def measured(*arguments):
    """Methods of a task whose measures are made of these arguments."""
    return {"measure": lambda *_: Measures(*arguments)}


def measured_from(expression):
    """Methods of a task that measures an expression of `state` and `episode`."""
    return {"measure": eval(f"lambda self, state, episode: {expression}")}


BAD_METHODS = [
    ({"measure": lambda *_: 0.5}, r"measure\(\)=0.5.*`Measures`"),
    (measured(np.nan, {}), "performance=nan.*a finite number"),
    (measured(np.zeros(2), {}), r"performance has shape \(2,\): .* a finite number"),
    (measured(0.5, 0.5), "rewards=0.5.*a dict from names to numbers"),
    (measured(0.5, {"a": np.inf}), r"rewards\['a'\]=inf"),
    (measured(0.5, {}, [1.0]), r"info=\[1.0\].*a dict"),
    (measured(0.5, {}, {"where": np.zeros(3)}), r"info\['where'\] has shape \(3,\): .* a number"),
    (measured(0.5, {}, {"performance": 3.0}), "info='performance'.*success, variation"),
    (measured(0.5, {"a": 0.5}, {"reward_a": 9.0}), "info='reward_a'.*without the prefix reward_"),
    (measured(0.5, {}, {"picks_held": 5}), r"\['picks_held'\].*without duplicates"),
    ({"diagnostics": lambda self: {"variation": 5}}, r"\['variation'\].*without duplicates"),
    ({"bounds": lambda *_: (0.0, 0.0)}, r"bounds\(\)=\(0.0, 0.0\).*lower < upper"),
    ({"bounds": lambda *_: 1.0}, r"bounds\(\)=1.0"),
    ({"reduced": lambda *_: [1.0]}, r"reduced\(\)=\[1.0\].*a dict from names to entries"),
    ({"reduced": lambda *_: {"a": np.zeros(2)}}, r"reduced\(\)\['a'\].*an entry: `numbers`"),
    (
        {"extra_state": lambda *_: {"a": np.zeros(2)}},
        r"extra_state\(\)\['a'\].*an entry: `numbers`",
    ),
    (
        {"reduced": lambda *_: {"a": numbers(np.array([np.nan]))}},
        r"reduced\(\)\['a'\].*finite numbers",
    ),
    ({"reduced": lambda *_: {"a": numbers(np.zeros((1, 1)))}}, r"reduced\(\)\['a'\].*finite"),
    ({"reduced": lambda *_: {"a": point(np.zeros(2))}}, r"reduced\(\)\['a'\].*a point \(3,\)"),
    ({"reduced": lambda *_: {"a": points(np.zeros((1, 2)))}}, r"reduced\(\)\['a'\].*\(k, 3\)"),
    ({"reduced": lambda *_: {"a": numbers(0.5)}}, r"reduced\(\)\['a'\]=0.5.*an array"),
    ({"reduced": lambda *_: {"a": point([0.0, 0.0, 0.0])}}, r"reduced\(\)\['a'\].*an array"),
    (
        {"reduced": lambda *_: {"a": point(np.zeros(3), "owner")}},
        r"role of reduced\(\)\['a'\]='owner'.*'object', 'goal', 'other'",
    ),
    ({"resize": lambda self, variation: None}, r"resize\(\)=None.*True if the model changed"),
    ({"goal": lambda *_: np.zeros(3)}, r"episode.goal=array.*a dict from names to arrays"),
    ({"goal": lambda *_: {"a": "x"}}, r"goal\(\)\['a'\]='x'.*finite numbers"),
    ({"goal": lambda *_: {"a": np.array([np.nan])}}, r"goal\(\)\['a'\].*finite numbers"),
    (measured_from("state.points['clth']"), "state.points='clth'.*did you mean 'cloth'"),
    (measured_from("state.present['']"), "state.present=''.*valid choices: 'cloth'"),
    (measured_from("state.poses['cup']"), "state.poses='cup'.*because it is empty"),
    (measured_from("episode.points['rope']"), "episode.points='rope'.*'cloth'"),
    (measured_from("episode.shapes['rope']"), "episode.shapes='rope'.*'cloth'"),
    (measured_from("episode.goal['x']"), "episode.goal='x'.*because it is empty"),
]


@pytest.mark.parametrize(("methods", "message"), BAD_METHODS)
def test_wrong_return_values_are_errors(methods, message):
    with pytest.raises(InvalidArgumentError, match=message):
        started(type("Bad", (Counting,), methods)())


def test_numbers_of_all_kinds_are_right():
    numbers = np.float32(0.5), {"a": np.float64(0.25), "b": True}, {"n": np.int64(3), "nan": np.nan}
    env = started(type("Good", (Counting,), measured(*numbers))())
    assert env.task.last_evaluation.reward == 1.25
    assert env.info()["n"] == 3 and np.isnan(env.info()["nan"])


def test_the_start_is_above_the_floor():
    with pytest.raises(InvalidArgumentError, match=r"lowest point of 'cloth'=-0.095.*`arrange`"):
        started(Counting(height=-0.1))
    started(Counting(height=-0.005))  # Its middle, which is 5 mm above what it lies on.
    pit = Counting(height=-0.1)
    pit.root_entity.mjcf_model.find("geom", "floor").remove()
    assert started(pit).task.points()[:, 2].max() < -0.09


# ------------------------------------------------------------------ wrong arguments


@pytest.mark.parametrize(
    ("data", "arguments", "message"),
    [
        ({}, {"objects": 3}, "objects=3.*a list of ropes"),
        ({}, {"objects": ["cloth"]}, r"objects=\['cloth'\]"),
        ({}, {"actor": "hand"}, "actor='hand'.*'picker', 'pick_and_place'"),
        ({}, {"actor": "picker", "arms": 1}, "arms=1.*None with actor='picker'"),
        ({"view": "kitchen"}, {}, "view='kitchen'.*a View, or one of 'cloth', "),
        ({"view": ((0, 0, 1), (1, 0, 0, 0))}, {}, "view=.*a View, or one of 'cloth', "),
        ({"workspace": ((-1, -1, 0), (1, 1, 1))}, {}, r"workspace=.*a Workspace\("),
        ({"symmetries": "same"}, {}, "symmetries='same'.*`anywhere` or `mirrored`"),
        ({"symmetries": anywhere}, {}, "symmetries=.*`anywhere` or `mirrored`"),
        ({"success": "x"}, {}, "success='x'.*a finite number"),
        ({"success": np.nan}, {}, "success=nan.*a finite number"),
        ({"material": "towel"}, {}, "material='towel'.*'cloth', 'rope'"),
    ],
)
def test_wrong_arguments_and_class_data_are_errors(data, arguments, message):
    with pytest.raises(InvalidArgumentError, match=message):
        type("Bad", (Counting,), data)(**arguments)


def test_a_task_has_a_start_or_arranges():
    class Nowhere(Task):
        measure = Counting.measure

    with pytest.raises(InvalidArgumentError, match=r"start=None.*a method `arrange`"):
        Nowhere([Cloth(dims=DIMS)])


def test_an_actor_may_be_given_as_such():
    picker = Picker(num_pickers=1)
    assert started(Counting(actor=picker)).task.actor is picker


def test_the_scene_is_there_after_the_constructor():
    class Early(Counting):
        def __init__(self):
            self.root_entity.mjcf_model.worldbody.add("geom", type="box", size=[0.1, 0.1, 0.1])
            super().__init__()

    with pytest.raises(SoftGymError, match="call super"):
        Early()


def test_a_task_calls_the_constructor_of_task(register):
    class Unfinished(Counting):
        def __init__(self):
            self.count = 0

    register("unfinished", Unfinished, horizon=5)
    with pytest.raises(SoftGymError, match="call super"):
        softgym_mj.load("unfinished")


def test_only_bodies_of_the_scene_confine_water():
    water = Water(Liquid(2e-4), Resolution(8, 0.018, (2, 2)))
    task = Counting(objects=[Cloth(dims=DIMS), water])
    world = task.root_entity.mjcf_model.worldbody
    geom = world.add("geom", type="box", size=[0.1, 0.1, 0.1])
    for wrong in ("glass", geom, world, None):
        with pytest.raises(InvalidArgumentError, match=r"bodies=.*MJCF elements `body`"):
            water.confine(wrong)
    with pytest.raises(InvalidArgumentError, match=r"bodies='cup'.*scene that the water"):
        water.confine(mjcf.RootElement().worldbody.add("body", name="cup"))
    water.confine(world.add("body"))


# ------------------------------------------------------------------ snapshots


def test_snapshots_hold_what_a_task_adds_to_them():
    env, other = started(Counting()), started(Counting())
    env.step(np.zeros(8))
    snapshot = env.get_state()
    for again in (env, other):
        again.set_state(snapshot)
        assert again.task.last_evaluation.reward == 2.0
        assert [again.step(np.zeros(8)).reward for _ in range(2)] == [3.0, 4.0]


def test_snapshots_fit_the_same_arguments_only(register):
    register("counting", Counting, horizon=5)
    env = softgym_mj.load("counting", height=0.2)
    env.reset(800)
    snapshot = env.get_state()
    same = softgym_mj.load("counting", height=0.2, observation="full", image_size=(40, 40))
    same.set_state(snapshot)
    np.testing.assert_array_equal(same.task.points(), env.task.points())
    for height in (0.1, 0.3):
        with pytest.raises(SnapshotError, match=r"arguments={'height': '0.2'} against"):
            softgym_mj.load("counting", height=height).set_state(snapshot)
    usual = softgym_mj.load("counting", actor="picker")
    usual.reset(800)
    softgym_mj.load("counting", height=0.1).set_state(usual.get_state())  # What it is by default.
    assert "arguments" not in softgym_mj.load("straighten_rope", actor="picker").task.snapshot_key


@pytest.mark.parametrize(
    ("task", "name", "usual", "other"),
    [
        ("rope_configuration", "matching", "key_points", "vertices"),
        ("drop_cloth", "sizes", [60, 100], (70, 100)),
    ],
)
def test_snapshots_of_shipped_tasks_fit_the_same_arguments_only(task, name, usual, other):
    env = softgym_mj.load(task, split="all", **{name: other})
    env.reset(800)
    snapshot = env.get_state()
    softgym_mj.load(task, **{name: other}).set_state(snapshot)
    with pytest.raises(SnapshotError, match=rf"arguments={{'{name}': .* against None"):
        softgym_mj.load(task).set_state(snapshot)
    env = softgym_mj.load(task, split="all")
    env.reset(800)
    softgym_mj.load(task, **{name: usual}).set_state(env.get_state())


# ------------------------------------------------------------------ tasks registered again


def rewarding(value, dims=DIMS):
    """A class as a notebook defines it: other processes cannot import it."""

    class Mine(Counting):
        def __init__(self, **settings: Unpack[TaskSettings]):
            cloth = Cloth(dims=dims)
            super().__init__(objects=[cloth], **settings)
            self.cloth = cloth

        def measure(self, state, episode):
            return Measures(value, {"value": value})

    return Mine


@pytest.mark.parametrize(
    "executor", [SerialExecutor(), ProcessExecutor(1)], ids=["serial", "processes"]
)
def test_the_task_that_was_registered_last_is_played(executor, register, tmp_path):
    planning = Planning(horizon=2, budget=20, iterations=1, replan_every=2)
    with executor:
        for value, dims in ((0.5, DIMS), (0.25, DIMS), (0.75, (20, 20))):
            register("mine", rewarding(value, dims), horizon=2)
            env = softgym_mj.load("mine")
            env.reset(800)
            returns = ExecutorRollouts("mine", {}, executor).returns(
                env.get_state(), np.zeros((2, 2, 8))
            )
            assert returns.tolist() == [2 * value, 2 * value]
            for policy in ("zero", "cem"):
                configuration = Configuration(
                    "mine", policy, (800,), planning=planning if policy == "cem" else None
                )
                result = evaluate(configuration, str(tmp_path / f"{policy}{value}"), executor)
                assert result["episodes"][0]["return"] == 2 * value
