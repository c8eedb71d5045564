"""The picker against SoftGym's semantics (docs/softgym.md 2.1 to 2.4), worked out by hand.

Which vertex is taken is in test_grip.py. Most tests take one sim step per env step
(`action_repeat=1`), so that every step can be followed.
"""

import dataclasses

import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities.flex import Flex
from softgym_mj.envs.environment import Environment
from softgym_mj.robots.picker import Picker
from softgym_mj.robots.workspace import Workspace

SIM_STEP = 0.01  # [s]
FULL = 0.01  # Displacement of an action of 1 in a sim step [m].
GRAVITY = 9.8
OFF, ON = -1.0, 1.0


@dataclasses.dataclass(frozen=True)
class Facts:
    """docs/softgym.md 2.1 to 2.3 of a kind of object [m]."""

    task: str
    radius: float
    pick_distance: float
    reset_height: float
    spread: float  # Distance of two pickers at reset.
    half_x: float  # Range of the center around the reset point.
    half_y: float
    low: float
    high: float


ROPE = Facts("straighten_rope", 0.02, 0.05, 0.10, 0.08, 0.33, 0.33, 0.02, 0.28)
CLOTH = Facts("spread_cloth", 0.05, 0.06125, 0.20, 0.20, 0.65, 0.35, 0.05, 0.45)
BOTH = pytest.mark.parametrize("facts", [ROPE, CLOTH], ids=["rope", "cloth"])


@dataclasses.dataclass(frozen=True)
class Scene:
    """A running environment and its parts."""

    env: Environment
    target: Flex
    actor: Picker
    facts: Facts

    def lay(self, vertices: np.ndarray | None = None) -> np.ndarray:
        """Lays the object out, flat and straight if no vertices are given; returns them."""
        if vertices is None:
            target = self.target
            vertices = target.straight() if self.facts is ROPE else target.flat()
        self.target.set_points(vertices)
        return self.target.points()

    def place(self, *positions) -> None:
        """Puts the pickers down, open, in the workspace around the origin."""
        facts = self.facts
        half = np.array([facts.half_x, facts.half_y]) + facts.radius
        workspace = Workspace((*-half, 0.0), (*half, facts.high + facts.radius))
        self.actor.place(np.array(positions, float), workspace)

    def step(self, *moves) -> None:
        """One env step; each move is (dx, dy, dz, grip) of a picker."""
        self.env.step(np.concatenate(moves))

    def held(self) -> list[int]:
        return self.actor.held.tolist()


_scenes = {}


def make_scene(facts: Facts, num_pickers: int = 2, action_repeat: int = 1) -> Scene:
    """A scene after reset; environments are reused, since each test lays out its own state."""
    key = (facts.task, num_pickers, action_repeat)
    if key not in _scenes:
        settings = {"fidelity": "fast"} if facts is CLOTH else {}
        env = softgym_mj.load(
            facts.task,
            split=[0],
            horizon=10**6,
            num_pickers=num_pickers,
            action_repeat=action_repeat,
            **settings,
        )
        _scenes[key] = Scene(env, env.task.objects[0], env.task.actor, facts)
    _scenes[key].env.reset()
    return _scenes[key]


def box_center(vertices: np.ndarray) -> np.ndarray:
    return (vertices.min(axis=0) + vertices.max(axis=0))[:2] / 2


# ---------------------------------------------------------------- geometry and limits


@BOTH
def test_two_pickers_at_reset(facts):
    scene = make_scene(facts)
    x, y = box_center(scene.target.points())
    half = facts.spread / 2
    top = scene.target.points()[:, 2].max()  # 0.18 m for this pile.
    height = top + 0.06 if facts is CLOTH else facts.reset_height
    expected = [[x, y - half, height], [x, y + half, height]]
    np.testing.assert_allclose(scene.actor.positions(), expected, atol=1e-12)
    assert scene.held() == [-1, -1]


def test_one_and_three_pickers_at_reset():
    scene = make_scene(ROPE, num_pickers=1)
    x, y = box_center(scene.target.points())
    np.testing.assert_allclose(scene.actor.positions(), [[x, y, 0.1]], atol=1e-12)
    scene = make_scene(ROPE, num_pickers=3)
    # A ring of radius 2 r sqrt(2) from -Y, every 120 degrees.
    ring = 0.0565685425
    expected = [
        [x, y - ring, 0.1],
        [x + 0.8660254038 * ring, y + 0.5 * ring, 0.1],
        [x - 0.8660254038 * ring, y + 0.5 * ring, 0.1],
    ]
    np.testing.assert_allclose(scene.actor.positions(), expected, atol=1e-9)
    assert scene.held() == [-1, -1, -1]


@pytest.mark.parametrize("action_repeat", [1, 8])
def test_displacement(action_repeat):
    scene = make_scene(ROPE, action_repeat=action_repeat)
    start = scene.actor.positions()
    scene.step([1, -1, 1, OFF], [0.3, 0.0, -0.05, OFF])
    expected = action_repeat * 0.01 * np.array([[1, -1, 1], [0.3, 0.0, -0.05]])
    np.testing.assert_allclose(scene.actor.positions() - start, expected, atol=1e-12)
    # The spheres are where the actor says.
    physics = scene.env.physics
    physics.forward()
    spheres = [physics.named.data.geom_xpos[f"picker/picker_{i}"] for i in range(2)]
    np.testing.assert_allclose(spheres, scene.actor.positions(), atol=1e-5)


@BOTH
def test_workspace_limits(facts):
    scene = make_scene(facts, action_repeat=8)
    x, y = box_center(scene.target.points())
    lowest = [x - facts.half_x, y - facts.half_y, facts.low]
    highest = [x + facts.half_x, y + facts.half_y, facts.high]
    for corner, direction in ((lowest, -1.0), (highest, 1.0)):
        for _ in range(int(2 * facts.half_x / 0.08) + 2):
            scene.step(*[[direction] * 3 + [OFF]] * 2)
            assert np.all(scene.actor.positions() >= np.array(lowest) - 1e-12)
            assert np.all(scene.actor.positions() <= np.array(highest) + 1e-12)
        np.testing.assert_allclose(scene.actor.positions(), [corner, corner], atol=1e-12)


# ---------------------------------------------------------------- which vertex is taken


@pytest.mark.parametrize(("grip", "holds"), [(0.0, False), (1e-3, True)])
def test_grip_threshold(grip, holds):
    scene = make_scene(ROPE, num_pickers=1)
    scene.lay()
    scene.place([0.0, 0.0, 0.04])
    scene.step([0, 0, 0, grip])
    assert scene.held() == [20 if holds else -1]


@BOTH
@pytest.mark.parametrize("direction", ["above", "beside"])
def test_pick_distance(facts, direction):
    scene = make_scene(facts, num_pickers=1)
    for excess, taken in ((-1e-6, True), (1e-6, False)):
        vertices = scene.lay()
        # The last vertex of the first row is an end of the rope and a corner of the cloth.
        index = len(vertices) - 1 if facts is ROPE else scene.target.corners[2]
        reach = facts.pick_distance + excess
        if direction == "above":
            offset = np.array([0.0, 0.0, reach])
        else:  # On the floor, beyond the end.
            height = facts.radius - vertices[index, 2]
            offset = np.array([np.sqrt(reach**2 - height**2), 0.0, height])
        scene.place(vertices[index] + offset)
        scene.step([0, 0, 0, ON])
        assert scene.held() == [index if taken else -1]


# ---------------------------------------------------------------- two pickers


def test_three_pickers_share_what_is_there():
    scene = make_scene(ROPE, num_pickers=3)
    scene.lay()
    scene.place(*[[0.001, 0.0, 0.04]] * 3)
    scene.step(*[[0, 0, 0, ON]] * 3)
    assert scene.held() == [20, 21, 19]
    assert scene.env.info()["picks_held"] == 3
    assert scene.env.info()["dropped"] == 0
    scene.step([0, 0, 0, ON], [0, 0, 0, OFF], [0, 0, 0, OFF])
    assert scene.env.info()["picks_held"] == 1
    assert scene.env.info()["dropped"] == 2


# ---------------------------------------------------------------- holding


def random_moves(number: int, length: int, seed: int) -> np.ndarray:
    """(number, 4) moves at full speed that change every `length` steps and lead upwards first."""
    random = np.random.default_rng(seed)
    directions = random.choice([-1.0, 1.0], (number // length + 1, 3))
    directions[0] = (1.0, -1.0, 1.0)
    return np.column_stack([np.repeat(directions, length, axis=0)[:number], np.full(number, ON)])


@BOTH
@pytest.mark.parametrize("action_repeat", [1, 8])
def test_offset_is_kept_at_full_speed(facts, action_repeat):
    scene = make_scene(facts, action_repeat=action_repeat)
    vertices = scene.lay()
    indices = [5, 33] if facts is ROPE else scene.target.corners[[1, 2]].tolist()
    offsets = np.array([[0.003, 0.002, 0.045], [-0.002, 0.004, 0.03]])
    scene.place(*(vertices[indices] + offsets))
    number, away = 48 // action_repeat, []
    for move in random_moves(number, max(1, 12 // action_repeat), seed=3):
        scene.step(move, move * [1, 1, 1, 1e-3])  # However faint, the grip holds.
        assert scene.held() == indices
        expected = scene.actor.positions() - offsets
        expected[:, 2] = np.maximum(expected[:, 2], scene.target.radius)
        found = scene.target.points()[indices]
        away.append(np.linalg.norm(found - expected, axis=1).max())
    # What is held gives way to layers and strands that hit it.
    assert np.quantile(away, 0.9) < 1e-3 and max(away) < 5e-3


def test_one_picker_holds_exactly_one_vertex():
    scene = make_scene(ROPE, num_pickers=1)
    vertices = scene.lay()
    scene.place(vertices[0] + [0.0, 0.0, 0.04])
    for _ in range(50):  # Past all others.
        scene.step([1, 0, 0, ON])
        assert scene.held() == [0]
    for _ in range(10):
        scene.step([0, 0, 1, ON])
    # The neighbors hang on the held end by the rope alone: a segment is 12.5 mm long.
    heights = scene.target.points()[:, 2]
    assert scene.held() == [0]
    assert heights[0] == pytest.approx(0.10625, abs=1e-3)
    assert heights[1] < heights[0] - 0.006


@BOTH
def test_held_vertex_stays_above_the_floor(facts):
    scene = make_scene(facts, num_pickers=1)
    vertices = scene.lay()
    index = 20 if facts is ROPE else scene.target.corners[0]
    drop = 0.9 * facts.pick_distance
    scene.place(vertices[index] + [0.0, 0.0, drop])
    scene.step([0, 0, 0, ON])
    assert scene.held() == [index]
    for _ in range(6):
        scene.step([0, 0, -1, ON])
        assert scene.target.vertex(index)[2] > scene.target.radius - 1e-3
    assert scene.actor.positions()[0, 2] == facts.radius
    # The offset is remembered: going up, the vertex follows once it belongs above the floor.
    for _ in range(8):
        scene.step([0, 0, 1, ON])
    expected = facts.radius + 8 * FULL - drop
    assert scene.target.vertex(index)[2] == pytest.approx(expected, abs=1e-3)


def test_retry_while_moving():
    # From y = -0.09 towards the rope at y = 0, 3 cm above the floor: 5 cm are reached between
    # y = -0.05 and y = -0.04, which is the old center in the sixth of eight sim steps.
    scene = make_scene(ROPE, num_pickers=1, action_repeat=8)
    scene.lay()
    scene.place([0.0, -0.09, 0.03])
    scene.step([0, 1, 0, ON])
    assert scene.actor.positions()[0, 1] == pytest.approx(-0.01)
    assert scene.held() == [20]
    assert scene.target.vertex(20)[1] == pytest.approx(3 * FULL, abs=1e-3)


# ---------------------------------------------------------------- release


def test_released_vertex_falls():
    scene = make_scene(ROPE, num_pickers=1)
    vertices = scene.lay()
    vertices[:, 2] = 0.2
    scene.lay(vertices)
    masses = scene.env.physics.model.dof_M0.copy()
    scene.place([0.0, 0.0, 0.245])
    scene.step([0, 0, 0, ON])
    assert scene.held() == [20]
    assert scene.target.vertex(20)[2] == pytest.approx(0.2, abs=1e-4)
    substeps = 25  # Substeps of the solver in a sim step.
    timestep = SIM_STEP / substeps
    for number in range(1, 16):
        scene.step([0, 0, 0, OFF])
        assert scene.held() == [-1]
        released = number * substeps
        # Semi-implicit Euler: after n steps a body has fallen g dt^2 n (n + 1) / 2. The rope
        # began to fall one sim step before the vertex, which it then pulls along.
        own, ropes = (
            0.2 - GRAVITY * timestep**2 * n * (n + 1) / 2 for n in (released, released + substeps)
        )
        heights = scene.target.points()[:, 2]
        np.testing.assert_allclose(heights[[2, 38]], ropes, atol=1e-3)
        assert ropes - 1e-3 < heights[20] < own + 1e-3
    np.testing.assert_array_equal(scene.env.physics.model.dof_M0, masses)
    for _ in range(150):
        scene.step([0, 0, 0, OFF])
    np.testing.assert_allclose(scene.target.points()[:, 2], scene.target.radius, atol=1e-3)


def test_reset_and_place_open_the_grippers():
    scene = make_scene(ROPE)
    masses = scene.env.physics.model.dof_M0.copy()
    for opening in (scene.env.reset, lambda: scene.place([0, 0, 0.1], [0, 0, 0.2])):
        scene.lay()
        scene.place([0.0, 0.0, 0.04], [0.1, 0.0, 0.04])
        scene.step([0, 0, 0, ON], [0, 0, 0, ON])
        assert scene.held() == [20, 28]
        assert not np.array_equal(scene.env.physics.model.dof_M0, masses)
        opening()
        assert scene.held() == [-1, -1]
        np.testing.assert_array_equal(scene.env.physics.model.dof_M0, masses)


# ---------------------------------------------------------------- solid spheres


@pytest.mark.parametrize(
    ("speed", "moved"),
    [(1.0, 0.005), (0.2, 0.01), pytest.param(0.05, 0.015, marks=pytest.mark.slow)],
)
def test_solid_picker_pushes_the_rope(speed, moved):
    scene = make_scene(ROPE, num_pickers=1)
    scene.lay()
    scene.place([0.0, -0.06, 0.02])
    for _ in range(round(0.1 / (speed * FULL))):  # 6 cm to the rope, 4 cm beyond its place.
        scene.step([0, speed, 0, OFF])
        # A vertex, the middle of a rope of 6.25 mm radius, never gets inside the solid sphere.
        distances = np.linalg.norm(scene.target.points() - scene.actor.positions(), axis=1)
        assert distances.min() > ROPE.radius
    for _ in range(20):
        scene.step([0, 0, 0, OFF])
    distances = np.linalg.norm(scene.target.points() - scene.actor.positions(), axis=1)
    # Against bodies as small as a picker flexes are 2 mm thick.
    assert distances.min() > ROPE.radius + 0.0018
    assert scene.held() == [-1]
    assert scene.target.vertex(20)[1] > moved
