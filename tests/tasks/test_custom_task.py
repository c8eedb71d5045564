"""The task that notebook 05 writes, and what it takes to write one: `Task` and `register`."""

import json
import pathlib
from typing import Unpack

import gymnasium
import numpy as np
import pytest
from dm_control import suite

import softgym_mj
from softgym_mj.entities import CameraPose, Cloth, Garment, Rope, View
from softgym_mj.entities.fabric import AREA_DENSITY
from softgym_mj.envs.environment import Environment
from softgym_mj.exceptions import InvalidArgumentError, UnexpectedArgumentError
from softgym_mj.fluid import Liquid, Resolution, Water
from softgym_mj.policies.planners import make_planner
from softgym_mj.rendering.offscreen import CameraView
from softgym_mj.tasks import Measures, Task, TaskSettings

NOTEBOOK = pathlib.Path(__file__).parents[2] / "notebooks" / "05_custom_task.ipynb"
MOST_LINES = 60
VARIATION = 803


class Straight(Task):
    """The shortest task: a rope on a cloth, straight."""

    material, horizon = "rope", 5

    def __init__(self, **settings: Unpack[TaskSettings]):
        self.cloth = Cloth(dims=(33, 33), fidelity="fast")
        self.rope = Rope("fast")
        super().__init__([self.cloth, self.rope], **settings)

    def arrange(self, random):
        self.cloth.set_points(self.cloth.flat(angle=random.uniform(-1.0, 1.0)))
        self.rope.set_points(self.rope.straight() + [0.0, 0.0, 2 * self.cloth.radius])

    def measure(self, state, episode):
        distance = self.rope.end_distance()
        return Measures(distance / 0.5, {"distance": distance})


def definition():
    """The lines of the notebook's cells that define scene and task."""
    cells = json.loads(NOTEBOOK.read_text())["cells"]
    marked = [c for c in cells if "definition" in c["metadata"].get("tags", ())]
    assert all(cell["cell_type"] == "code" for cell in marked)
    return "\n".join("".join(cell["source"]) for cell in marked)


@pytest.fixture(scope="module")
def notebook():
    """Returns what the notebook's cells define."""
    namespace: dict = {"__name__": "notebook"}
    exec(definition(), namespace)
    return namespace


def washing(notebook, **settings):
    return Environment(
        notebook["SaveTheWashing"](**settings), name="washing", horizon=24, split="evaluate"
    )


@pytest.fixture(scope="module")
def instances(notebook):
    """Two environments of the notebook's task."""
    return washing(notebook), washing(notebook)


def rescue(env):
    """One picker to the middle of the rope, one to a sleeve; then up."""
    task = env.task
    vertices = task.flexes.points()
    middle = task.towel.num_points + task.rope.num_points // 2
    first = task.towel.num_points + task.rope.num_points
    goals = (middle, first + int(np.argmax(task.shirt.points()[:, 0])))
    actions = []
    for i, goal in enumerate(goals):
        way = vertices[goal] + [0.0, 0.0, 0.03] - task.actor.commanded_positions()[i]
        near = np.linalg.norm(way) < 0.035 or task.actor.held[i] >= 0
        actions.append([0.0, 0.0, 0.6, 1.0] if near else [*np.clip(way / 0.08, -1, 1), -1.0])
    return np.concatenate(actions)


# ------------------------------------------------------------------ the notebook's task


def test_the_notebook_defines_four_kinds_in_less_than_sixty_lines(notebook):
    lines = [line.strip() for line in definition().splitlines()]
    assert sum(bool(line) and not line.startswith("#") for line in lines) < MOST_LINES
    task = notebook["SaveTheWashing"]()
    kinds = [type(thing) for thing in task.objects]
    assert kinds == [Cloth, Rope, Garment, Water]
    assert issubclass(notebook["SaveTheWashing"], Task)


def test_lifting_keeps_the_washing_dry_and_nothing_does_not(instances):
    env, _ = instances
    ends = {}
    policies = {"rescue": (rescue, 18), "nothing": (lambda env: np.zeros(8), 12)}
    for name, (policy, steps) in policies.items():
        env.reset(VARIATION)
        for _ in range(steps):
            timestep = env.step(policy(env))
            terms = {k: v for k, v in env.info().items() if k.startswith("reward_")}
            assert timestep.reward == pytest.approx(sum(terms.values()))
        ends[name] = env.info()
        assert ends[name]["physics_warnings"] == 0
        for flex in env.task.flexes.flexes:
            assert np.percentile(np.abs(flex.edge_strain()), 99) < 0.2  # One is being lifted.
    assert ends["rescue"]["normalized_performance"] > 0.9 and ends["rescue"]["success"]
    assert ends["rescue"]["picks_held"] == 2
    assert ends["nothing"]["normalized_performance"] < 0.6


def test_snapshots_continue_with_the_same_bits_in_another_instance(instances):
    env, other = instances
    env.reset(VARIATION)
    for _ in range(8):
        env.step(rescue(env))
    owners = [env.task.flexes.owner(int(v))[0] for v in env.task.actor.held if v >= 0]
    assert owners == [env.task.rope, env.task.shirt]  # One vertex of each is held.
    snapshot = env.get_state()
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (3, 8))
    here = [env.step(action) for action in actions]
    after = env.task.points()
    env.set_state(snapshot)
    other.set_state(snapshot)
    for again in (env, other):
        there = [again.step(action) for action in actions]
        assert [t.reward for t in there] == [t.reward for t in here]
        np.testing.assert_array_equal(again.task.points(), after)
        np.testing.assert_array_equal(
            there[-1].observation["reduced"], here[-1].observation["reduced"]
        )


def test_variations_differ_and_are_the_same_in_every_instance(instances):
    env, other = instances
    starts = []
    for variation in (800, 801):
        for instance in (env, other):
            instance.reset(variation)
        np.testing.assert_array_equal(env.task.points(), other.task.points())
        starts.append(env.task.points())
    assert np.abs(starts[1] - starts[0]).max() > 0.01
    # Nothing is stretched, nothing crosses at the start.
    for flex in env.task.flexes.flexes:
        np.testing.assert_allclose(flex.edge_strain(), 0.0, atol=1e-6)
    assert env.task.shirt.intersections() == env.task.towel.intersections() == 0


def test_its_picture_shows_all(instances):
    env, _ = instances
    env.reset(VARIATION)
    picture = CameraView("task", 120, 160).rgb(env.physics).astype(int)
    yellow = (picture[..., 0] > picture[..., 2] + 60) & (picture[..., 1] > picture[..., 2] + 40)
    blue = (picture[..., 2] > picture[..., 0] + 40) & (picture[..., 2] > picture[..., 1] + 20)
    white = (picture.min(axis=-1) > 200) & (np.ptp(picture, axis=-1) < 25)
    assert min(yellow.sum(), blue.sum()) > 100 and white.sum() > 10  # Shirt, water, rope.


# ------------------------------------------------------------------ any task


def test_parameters_of_an_object_have_its_name(notebook, instances):
    usual, _ = instances
    changed = washing(
        notebook, domain={"shirt_density": 0.25, "water_viscosity": (3e-4, 4e-4), "towel_hue": 20}
    )
    for env in (usual, changed):
        env.reset(VARIATION)
    masses = []
    for env in (usual, changed):
        model = env.physics.model.ptr
        names = [model.body(i).name.split("/")[0] for i in range(model.nbody)]
        masses.append({n: model.body_mass[np.array(names) == n].sum() for n in set(names)})
    assert masses[1]["shirt"] == pytest.approx(0.25 / AREA_DENSITY * masses[0]["shirt"])
    assert masses[1]["towel"] == masses[0]["towel"] and masses[1]["rope"] == masses[0]["rope"]
    info = changed.info()
    assert info["domain_shirt_density"] == 0.25
    assert 3e-4 <= info["domain_water_viscosity"] <= 4e-4
    names = {parameter.name for parameter in changed.task.domain.parameters}
    assert {"rope_friction", "towel_layer_friction", "camera_x"} <= names
    with pytest.raises(InvalidArgumentError, match="domain parameter='density'"):
        notebook["SaveTheWashing"](domain={"density": 0.4})


def test_what_is_registered_is_everywhere(register):
    register("straight", Straight, horizon=7)
    record = register("straight", Straight, horizon=5, summary="Straight.")  # Replaces it.
    assert record.gymnasium_id == "softgym_mj/Straight-v0"
    assert "actor" in record.arguments and "domain" in record.arguments
    rewards = []
    for env in (
        softgym_mj.load("straight", split=[800]),
        suite.load("softgym", "straight", {"split": [800]}),
        Environment(Straight(), name="straight", horizon=5, split=[800]),
    ):
        env.reset()
        rewards.append(env.step(np.full(8, 0.1)).reward)
        assert env.horizon == 5
    gym = gymnasium.make("softgym_mj/Straight-v0", split=[800], disable_env_checker=True)
    gym.reset()
    rewards.append(gym.step(np.full(8, 0.1))[1])
    assert len(set(rewards)) == 1
    assert make_planner("icem", "straight").horizon == Task.planning_horizon
    with pytest.raises(UnexpectedArgumentError, match="'sizes'; valid choices: 'actor', 'visual'"):
        softgym_mj.load("straight", sizes=3)


@pytest.mark.filterwarnings("ignore:.*out of date")
def test_a_version_is_part_of_the_id(register):
    register("straight", Straight, horizon=5)
    record = register("straight", Straight, horizon=5, version=2)
    assert record.gymnasium_id == "softgym_mj/Straight-v2"
    assert gymnasium.spec("softgym_mj/Straight-v2").version == 2
    with pytest.raises(gymnasium.error.DeprecatedEnv, match="v0"):
        gymnasium.make("softgym_mj/Straight-v0")
    with pytest.raises(InvalidArgumentError, match="version=-1"):
        register("straight", Straight, version=-1)


def test_a_registered_task_runs_in_other_processes(register):
    register("straight", Straight, horizon=5)
    # These know nothing of what this one has registered.
    vector = gymnasium.make_vec("softgym_mj/Straight-v0", num_envs=1, context="spawn", split=[800])
    try:
        vector.reset(seed=0)
        _, rewards, *_ = vector.step(np.full((1, 8), 0.1, np.float32))
    finally:
        vector.close()
    env = softgym_mj.load("straight", split=[800])
    env.reset()
    assert rewards == pytest.approx([env.step(np.full(8, 0.1, np.float32)).reward])


class Nameless(Straight):
    """A task that does not say what it takes."""

    def __init__(self, **settings):
        super().__init__(**settings)


class Unmeasured(Task):
    """A task without the method `measure`."""


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("Straight", Straight), "name='Straight'.*lower-case words"),
        (("spread_cloth", Straight), "name='spread_cloth'.*none of the package's: drop_cloth"),
        (("straight", "Straight"), "task_class='Straight'.*a subclass"),
        (("straight", Nameless), r"write `\*\*settings: Unpack\[TaskSettings\]`"),
        (("straight", Unmeasured), r"task_class=.*Unmeasured'> lacks the methods: measure$"),
    ],
)
def test_what_cannot_be_registered(arguments, message):
    with pytest.raises(InvalidArgumentError, match=message):
        softgym_mj.register(*arguments, horizon=5)
    with pytest.raises(InvalidArgumentError, match="horizon=0"):
        softgym_mj.register("straight", Straight, horizon=0)
    assert "straight" not in softgym_mj.TASKS


def test_an_environment_is_of_a_task():
    with pytest.raises(InvalidArgumentError, match=r"task='straight'.*tasks.Task"):
        Environment("straight", name="straight", horizon=5)


class Still(Task):
    """A task that does not care."""

    def arrange(self, random):
        pass

    def measure(self, state, episode):
        return Measures(0.0, {})


def test_objects_that_do_not_go_together_are_errors():
    water = Water(Liquid(2e-4), Resolution(8, 0.018, (2, 2)))
    with pytest.raises(InvalidArgumentError, match="at least one rope, cloth or garment"):
        Still([water])
    with pytest.raises(InvalidArgumentError, match="a different `name`"):
        Still([Rope(), Rope()])


def test_arms_hold_what_they_find():
    env = Environment(Straight(actor="franka"), name="straight", horizon=40, split=[800])
    env.reset()
    task = env.task
    end = task.cloth.num_points + task.rope.num_points - 1
    hand = int(np.argmin(np.linalg.norm(task.actor.positions() - task.flexes.vertex(end), axis=1)))
    for _ in range(12):
        way = task.flexes.vertex(end) + [0, 0, 0.005] - task.actor.positions()[hand]
        action = np.zeros((2, 4))
        action[hand] = [*np.clip(way / 0.08, -0.7, 0.7), np.linalg.norm(way) < 0.03]
        env.step(action.ravel())
    assert task.flexes.owner(int(task.actor.held[hand]))[0] is task.rope
    action[hand] = [0.0, 0.0, 0.5, 1.0]
    for _ in range(4):
        env.step(action.ravel())
    held = task.flexes.vertex(int(task.actor.held[hand]))
    assert held[2] > 0.08
    np.testing.assert_allclose(held, task.actor.positions()[hand], atol=0.03)


def test_states_are_listed_as_they_are():
    task = Straight(observation=["full", "reduced"])
    observation = Environment(task, name="straight", horizon=5).reset(3).observation
    middles = [task.cloth.points().mean(axis=0), task.rope.points().mean(axis=0)]
    expected = np.concatenate([*middles, *task.actor.positions()])
    np.testing.assert_allclose(observation["reduced"], expected, atol=1e-12)
    entries = task.reduced(task.state(), task.episode)
    assert sum(np.size(entry.values) for entry in entries.values()) == 6
    assert len(observation["full"]) == 3 * task.flexes.num_points + 6


def test_a_camera_looks_where_it_is_told_to():
    # SoftGym's camera over a cloth is tilted by 45 degrees, upright and in front of it.
    pose = CameraPose.looking((0.0, -0.82, 0.82), at=(0.0, 0.0, 0.0))
    np.testing.assert_allclose(pose.quaternion, (0.9239, 0.3827, 0.0, 0.0), atol=1e-4)
    # From straight above, +Y is upwards.
    pose = CameraPose.looking((0.1, 0.2, 1.0), at=(0.1, 0.2, 0.0))
    np.testing.assert_allclose(pose.quaternion, (1.0, 0.0, 0.0, 0.0), atol=1e-12)
    with pytest.raises(InvalidArgumentError, match="a point other than position"):
        CameraPose.looking((0.0, 0.0, 1.0), at=(0.0, 0.0, 1.0))
    with pytest.raises(InvalidArgumentError, match=r"field_of_view=180\.0 .*> 0"):
        CameraPose.looking((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 180.0)

    class Seen(Still):
        view = View(CameraPose.looking((1, 2, 3), (4, 6, 3), 33.0))

    env = Environment(Seen([Rope()], num_pickers=1), name="still", horizon=5)
    env.reset()
    data = env.physics.data.ptr
    camera = env.physics.model.ptr.camera("task").id
    assert env.physics.model.ptr.cam_fovy[camera] == 33.0
    forward, right = -data.cam_xmat[camera].reshape(3, 3)[:, 2], data.cam_xmat[camera, ::3]
    np.testing.assert_allclose(forward, [0.6, 0.8, 0.0], atol=1e-9)
    np.testing.assert_allclose(right, [0.8, -0.6, 0.0], atol=1e-9)


class Drawn(Task):
    """A rope whose goal a hook draws at the start."""

    material, horizon = "rope", 5

    def __init__(self, **settings: Unpack[TaskSettings]):
        self.rope, self.place = Rope("fast"), 0.0
        super().__init__([self.rope], **settings)

    def arrange(self, random):
        self.rope.set_points(self.rope.straight() + [0.0, 0.0, 0.01])

    def initialize_episode(self, physics, random_state):
        self.place = random_state.uniform()
        super().initialize_episode(physics, random_state)

    def goal(self, variation, points):
        return {"place": np.array([self.place, 0.0, 0.0])}

    def measure(self, state, episode):
        place = 0.0 * state.points["rope"][..., 0].mean(-1) + episode.goal["place"][..., 0]
        return Measures(place, {"place": place})


GOALS = {v: np.random.RandomState([0x53544152, v]).uniform() for v in (5, 6)}


@pytest.mark.parametrize("device", ["cpu", "host"])
def test_goals_that_hooks_draw_belong_to_the_variation(register, device):
    register("drawn", Drawn)
    envs = softgym_mj.make_vec("drawn", 2, device=device)
    variations = {"variation": [5, 6]}
    expected = [GOALS[5], GOALS[6]]
    np.testing.assert_array_equal(envs.reset(options=variations)[1]["performance"], expected)
    snapshots = envs.get_state()
    envs.reset(options={"variation": [7, 8]})
    infos = envs.set_state(snapshots[::-1])[1]
    np.testing.assert_array_equal(infos["performance"], expected[::-1])
    envs.close()


def test_a_restored_environment_has_the_goal_that_hooks_drew(register):
    register("drawn", Drawn)
    env, other = (softgym_mj.load("drawn", split="all", random_state=k) for k in (1, 2))
    env.reset(5)
    other.set_state(env.get_state())
    assert env.info()["performance"] == other.info()["performance"] == GOALS[5]


@pytest.mark.parametrize("vector", [False, True])
def test_random_numbers_of_hooks_depend_on_the_variation_alone(register, vector):
    class Windy(Straight):
        """A straight rope whose length is noisy."""

        def after_step(self, physics, random_state):
            super().after_step(physics, random_state)
            self.noise = random_state.uniform()

        def info(self):
            return {**super().info(), "noise": np.float64(getattr(self, "noise", 0.0))}

    register("windy", Windy)
    env = softgym_mj.make_vec("windy", 1) if vector else gymnasium.make("softgym_mj/Windy-v0")
    zeros, noise = np.zeros(env.action_space.shape, np.float32), []
    for variation in (800, 801, 800):
        env.reset(options={"variation": [variation] if vector else variation})
        noise.append([float(np.squeeze(env.step(zeros)[-1]["noise"])) for _ in range(2)])
    assert noise[0] == noise[2] != noise[1]
    expected = np.random.RandomState([0x484F4F4B, 800])
    assert noise[0] == [expected.uniform(), expected.uniform()]
    env.close()
    if not vector:
        own = softgym_mj.load("windy", split="all", random_state=3)
        zero = np.zeros(own.action_spec().shape)
        for _ in range(2):
            played = [own.info()["noise"] for _ in own.play(lambda _: zero, 800)]
            assert played[1:3] == noise[0]
