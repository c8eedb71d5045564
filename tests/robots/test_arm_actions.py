"""Entries of arms' actions: poses against scipy's rotations, joints against sums."""

import gymnasium
import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError, SnapshotError
from softgym_mj.policies.experts import make_policy
from softgym_mj.robots.arm.arms import ACTIONS
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.arm.pose_action import MAX_TILT, MAX_TURN
from softgym_mj.robots.base import SIM_STEP
from softgym_mj.robots.gripper import MAX_DISPLACEMENT
from softgym_mj.viewing.teleoperation import teleoperate
from tests.contract.test_contract import actions, make
from tests.robots.arms import arms_of
from tests.robots.test_cartesian import Scene, in_front
from tests.scenes import arm_paths

PLACE = np.array([[0.45, 0.0, 0.3]])  # [m] Forward, left, up, where every arm turns freely.
TURNS = ["pose", "joints"]
# By how much of its limit a joint's speed changes from one solution to the next, 20 ms later: at
# most, and in 99 of 100. Of a Sawyer with positions: 1.11, 0.56.
JUMP, USUAL_JUMP = 1.15, 0.8


class Acting(Scene):
    """One or two arms with actions of a kind."""

    @classmethod
    def of(cls, arm, action, number=1):
        return cls(*arm_paths.scene("rope", arm, number, action))

    def turn(self, vector, steps, way=(0.0, 0.0, 0.0)):
        """Steps with `way` and a rotation vector, as fractions of the largest."""
        for _ in range(steps):
            self.step(np.array([[*way, *vector, -1.0]]))

    def orientation(self):
        self.arms.positions()
        return Rotation.from_matrix(self.arms.servos.rotations()[0])

    def commanded(self):
        return Rotation.from_quat(self.arms.commanded_quaternions()[0], scalar_first=True)


def tilt(orientation):
    """The angle from straight down to the tool's z axis [rad]."""
    return np.arccos(-orientation.as_matrix()[2, 2])


@arms_of("franka", "ur5e")
def test_a_pose_turns_about_the_tool_point_and_the_axes_of_the_world(arm):
    scene = Acting.of(arm, "pose")
    start = in_front(PLACE, ARMS[arm].distance)
    scene.start(start)
    home, expected, count = scene.orientation(), Rotation.identity(), 30
    assert tilt(home) < 1e-3
    for vector in ([0.0, 0.0, 1.0], [-0.5, 0.0, 0.0], [0.3, -0.8, 0.5]):
        scene.turn(vector, count, way=(0.2, 0.0, 0.0))
        scene.turn(np.zeros(3), 40)
        each = Rotation.from_rotvec(MAX_TURN * np.array(vector))
        expected = each**count * expected
        assert (scene.commanded() * (expected * home).inv()).magnitude() < 2e-3
        assert (scene.orientation() * (expected * home).inv()).magnitude() < 0.01
        start = start + [[0.2 * count * MAX_DISPLACEMENT, 0.0, 0.0]]
        np.testing.assert_allclose(scene.arms.positions(), start, atol=2e-3)
    assert scene.arms.diagnostics()["ik_failures"] == 0


def test_without_turns_a_pose_is_a_position():
    scenes = [Acting.of("franka", action) for action in ("position", "pose")]
    random = np.random.default_rng(0)
    for scene in scenes:
        scene.start(in_front(PLACE, ARMS["franka"].distance))
    for _ in range(20):
        way = random.uniform(-1.0, 1.0, (1, 3))
        for scene in scenes:
            for _ in range(4):
                scene.step(scene.arms.displacing(way, [True]))
    one, other = (scene.arms.positions() for scene in scenes)
    np.testing.assert_allclose(one, other, atol=1e-5)


def test_actions_are_built_from_a_row_per_hand_only():
    actor = Acting.of("franka", "pose").arms  # One hand.
    good = np.zeros((1, 3))
    for build in (actor.displacing, lambda moves, grips: actor.posing(good, moves, grips)):
        for moves, grips in ((np.zeros(3), [True]), (np.zeros((2, 3)), [True]), (good, True)):
            with pytest.raises(InvalidArgumentError, match=r"shape=\(.*expected \(1,( 3)?\)"):
                build(moves, grips)


@arms_of("franka")
def test_the_tilt_is_bounded_and_the_frame_comes_back(arm):
    scene = Acting.of(arm, "pose")
    start = in_front(PLACE, ARMS[arm].distance)
    scene.start(start)
    home = scene.orientation()
    for vector in ([-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]):
        largest = 0.0
        for _ in range(120):
            scene.turn(vector, 1)
            largest = max(largest, tilt(scene.commanded()))
        assert largest == pytest.approx(MAX_TILT, abs=1e-9)
        assert tilt(scene.orientation()) == pytest.approx(MAX_TILT, abs=0.02)
        np.testing.assert_allclose(scene.arms.positions(), start, atol=2e-3)
        scene.turn(-np.array(vector), round(MAX_TILT / MAX_TURN))
        scene.turn(np.zeros(3), 40)
        assert (scene.orientation() * home.inv()).magnitude() < 0.03
    assert scene.arms.diagnostics()["ik_failures"] == 0


# Where an elbow is stretched, where a hand is near the floor, and where a wrist is at its limit.
@pytest.mark.parametrize(
    ("place", "vector"),
    [
        ([0.75, 0.0, 0.3], [-1.0, 0.0, 0.0]),
        ([0.6, 0.0, 0.05], [1.0, 0.0, 0.0]),
        pytest.param([0.35, 0.0, 0.05], [1.0, 0.0, 0.0], marks=pytest.mark.long),
        ([0.45, 0.2, 0.3], [0.0, 0.0, 1.0]),
    ],
)
@arms_of("franka")
def test_a_turn_that_the_arm_cannot_make_waits_and_keeps_the_point(arm, place, vector):
    scene = Acting.of(arm, "pose")
    start, limits = in_front(np.array([place]), ARMS[arm].distance), scene.arms.arm.velocity_limits
    scene.start(start)
    home, last = scene.orientation(), np.zeros(len(limits))
    jumps, behind = [], []
    for direction, count in ((1.0, 300), (-1.0, 150)):
        for _ in range(count):
            scene.turn(direction * np.array(vector), 1)
            velocity = scene.arms.controller.velocity
            assert np.all(np.abs(velocity) <= np.add(limits, 1e-9))
            jumps.append(np.max(np.abs(velocity - last) / limits))
            last = velocity
            behind.append((scene.commanded() * scene.orientation().inv()).magnitude())
            if direction > 0.0:
                assert np.linalg.norm(scene.arms.positions() - start) < 0.015
    assert np.max(behind) < 0.45  # A lead of 0.2 and one of 0.1 rad, and what the joints lag.
    assert np.max(jumps) < JUMP and np.quantile(jumps, 0.99) < USUAL_JUMP
    # The frame comes back: to where it is told to be.
    for _ in range(300):
        to_home = (home * scene.commanded().inv()).as_rotvec() / MAX_TURN
        way = (start - scene.arms.commanded_positions())[0] / MAX_DISPLACEMENT
        scene.turn(np.clip(to_home, -1, 1), 1, way=np.clip(way, -1, 1))
    assert (scene.orientation() * home.inv()).magnitude() < 0.01
    np.testing.assert_allclose(scene.arms.positions(), start, atol=2e-3)
    assert scene.arms.diagnostics()["ik_failures"] == 0


@pytest.mark.parametrize("action", TURNS)
@arms_of("franka", "sawyer")
def test_random_actions_do_not_jump(arm, action):
    scene = Acting.of(arm, action, 2)
    scene.start(np.array([[0.0, -0.2, 0.2], [0.0, 0.2, 0.2]]))
    arms, model, data = scene.arms, scene.model, scene.data
    limits = arms.servos.velocity_limits
    pads, last, jumps = arms.servos.fingers.pads.ravel(), np.zeros(len(limits)), []
    random = np.random.default_rng(1)
    for i in range(400):
        if i % 8 == 0:
            entries = np.clip(random.uniform(-1.5, 1.5, arms.action_size), -1, 1)
        scene.step(entries)
        velocity = arms.controller.velocity
        jumps.append(np.max(np.abs(velocity - last) / limits))
        last = velocity
        half = np.abs(data.geom_xmat[pads].reshape(-1, 3, 3)[:, 2]) * model.geom_size[pads]
        assert (data.geom_xpos[pads][:, 2] - half.sum(axis=1)).min() > 0.0
        assert np.isfinite(data.qpos).all() and np.isfinite(arms.remembered()).all()
    assert np.max(jumps) < JUMP and np.quantile(jumps, 0.99) < USUAL_JUMP
    assert arms.diagnostics()["ik_failures"] == 0


@arms_of("franka", "ur5e")
def test_joints_go_where_they_are_told_to(arm):
    scene = Acting.of(arm, "joints")
    scene.start(in_front(PLACE, ARMS[arm].distance))
    arms = scene.arms
    servos, start = arms.servos, arms.controller.configuration
    fractions = np.linspace(-0.5, 0.5, len(start))
    for _ in range(20):
        scene.step(np.array([*fractions, 1.0]))
    expected = start + 20 * fractions * np.array(arms.arm.velocity_limits) * SIM_STEP
    np.testing.assert_allclose(arms.remembered()[4:], expected, atol=1e-12)
    for _ in range(50):
        scene.step(np.append(np.zeros(len(start)), 1.0))
    np.testing.assert_allclose(arms.controller.configuration, expected, atol=1e-4)
    np.testing.assert_allclose(scene.data.qpos[servos.positions_at], expected, atol=2e-3)
    # The commanded tool point by MuJoCo's own kinematics of the scene.
    scene.data.qpos[servos.positions_at] = expected
    mujoco.mj_kinematics(scene.model, scene.data)
    tool = scene.data.site(f"arms/{arm}_0/{arms.arm.tcp_site}").xpos
    np.testing.assert_allclose(arms.commanded_positions()[0], tool, atol=1e-9)


@arms_of("franka")
def test_joints_wait_at_their_limits_and_turn_back_at_once(arm):
    scene = Acting.of(arm, "joints")
    scene.start(in_front(PLACE, ARMS[arm].distance))
    arms, last = scene.arms, len(ARMS[arm].joints) - 1
    ends = scene.model.jnt_range[scene.model.actuator_trnid[arms.servos.motors, 0]]
    entries = np.zeros(last + 2)
    for sign, end in ((1.0, ends[last, 1]), (-1.0, ends[last, 0])):
        entries[last] = sign
        for _ in range(400):
            scene.step(entries)
        assert arms.remembered()[4:][last] == pytest.approx(end, abs=2e-3)
        angle = scene.data.qpos[arms.servos.positions_at][last]
        assert angle == pytest.approx(end, abs=0.01)
    entries[last] = 1.0
    for _ in range(30):
        scene.step(entries)
    assert scene.data.qpos[arms.servos.positions_at][last] > ends[last, 0] + 0.3


def test_joints_keep_hands_off_the_floor():
    """The shoulder of a Franka bends ahead and down; its joints go on, but for what stops them."""
    scene = Acting.of("franka", "joints")
    scene.start(in_front(PLACE, ARMS["franka"].distance))
    heights = []
    for _ in range(120):
        scene.step(np.array([0, 0.5, 0, 0, 0, 0, 0, -1.0]))
        heights.append(scene.arms.positions()[0, 2])
    assert 0.0 < heights[-1] < 0.2 and min(heights) > 0.01
    assert scene.arms.diagnostics()["ik_failures"] == 0


@pytest.mark.parametrize("action", TURNS)
def test_a_restore_continues_bit_equal(action):
    env = make("straighten_rope/franka", action=action, observation=["markov", "full"])
    env.reset(800)
    for entries in actions(env, 4, seed=2):
        env.step(entries)
    state, rest = env.get_state(), actions(env, 4, seed=3)
    first = [env.step(entries).observation for entries in rest]
    other = make("straighten_rope/franka", action=action, observation=["markov", "full"])
    for again in (env, other):
        again.set_state(state)
        for entries, expected in zip(rest, first, strict=True):
            found = again.step(entries).observation
            for name, values in expected.items():
                np.testing.assert_array_equal(found[name], values)
    with pytest.raises(SnapshotError, match="actor"):
        make("straighten_rope/franka").set_state(state)


@pytest.mark.parametrize(("action", "size"), [("pose", 14), ("joints", 16)])
def test_every_api_has_these_entries_from_minus_1_to_1(action, size):
    settings = {"actor": "franka", "action": action}
    env = softgym_mj.load("straighten_rope", **settings)
    spec, space = env.action_spec(), env.task.actor.actions
    assert spec.shape == (size,) == (len(space.entries),)
    assert np.all(spec.minimum == -1.0) and np.all(spec.maximum == 1.0)
    assert space.switches == (size // 2 - 1, size - 1)
    units = [unit for _, unit, _ in space.entries]
    assert units == (["m"] * 3 + ["rad"] * 3 + [""] if action == "pose" else ["rad"] * 7 + [""]) * 2
    actor = env.task.actor
    assert sum(actor.remembers.values()) == len(actor.remembered())
    single = gymnasium.make("softgym_mj/StraightenRope-v0", **settings)
    vector = softgym_mj.make_vec("straighten_rope", 1, **settings)
    box = gymnasium.spaces.Box(-1.0, 1.0, (size,), np.float32)
    assert single.action_space == vector.single_action_space == box
    single.close()
    vector.close()


def test_an_action_must_be_one_of_those_that_there_are():
    with pytest.raises(
        InvalidArgumentError, match=r"action='torques'.*'position', 'pose', 'joints'"
    ):
        make("straighten_rope/franka", action="torques")
    with pytest.raises(InvalidArgumentError, match="action=7"):
        make("straighten_rope/franka", action=7)
    with pytest.raises(InvalidArgumentError, match=r"action='pose'.*'picker'"):
        make("straighten_rope/picker", action="pose")
    with pytest.raises(TypeError, match="'action'"):
        make("pour_water/franka", action="pose")
    assert list(ACTIONS) == ["position", "pose", "joints"]
    env = make("straighten_rope/franka", action="joints")
    env.reset(800)
    with pytest.raises(InvalidArgumentError, match="joints"):
        make_policy(env)
    with pytest.raises(InvalidArgumentError, match="joints"):
        teleoperate(env)
    with pytest.raises(InvalidArgumentError, match="'pose'"):
        env.task.actor.commanded_quaternions()
    with pytest.raises(InvalidArgumentError, match=r"\(8,\).*\(16,\)"):
        env.step(np.zeros(8))
