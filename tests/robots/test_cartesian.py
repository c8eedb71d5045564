"""Cartesian control of the arms against motions of known speed, at the tasks' physics steps."""

import dataclasses
import math
from xml.etree import ElementTree

import mink
import mujoco
import numpy as np
import pytest

from softgym_mj.robots.arm import bodies as arm_bodies
from softgym_mj.robots.arm import cartesian
from softgym_mj.robots.arm.arms import Arms
from softgym_mj.robots.arm.command_filter import LEAD
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.arm.mounts import Mount, facing_each_other
from softgym_mj.robots.base import SIM_STEP
from tests.robots.arms import cases_of, motor_torques
from tests.scenes import arm_paths

arms_by_name = pytest.mark.parametrize("arm", ARMS)
cases = cases_of(("cloth", "rope"), "cloth/franka", "rope/sawyer")


@dataclasses.dataclass
class Scene:
    """Arms in a scene with the solver and step of a task; the object lies out of reach."""

    model: mujoco.MjModel
    data: mujoco.MjData
    arms: Arms

    @classmethod
    def make(cls, case: str, number: int = 1) -> "Scene":
        """With the object and the arms that a case "kind/arm" names."""
        return cls(*arm_paths.scene(*case.split("/"), number))

    def start(self, points: np.ndarray) -> None:
        self.arms.place(np.reshape(points, (-1, 3)), arm_paths.WORKSPACE)
        mujoco.mj_forward(self.model, self.data)

    def step(self, action: np.ndarray) -> None:
        """One sim step with an action (num_arms, 4)."""
        self.arms.command(np.clip(action, -1, 1).ravel())
        self.arms.plan()
        steps = round(SIM_STEP / self.model.opt.timestep)
        for i in range(steps):
            self.arms.move((i + 1) / steps, self.model.opt.timestep)
            mujoco.mj_step(self.model, self.data)

    def towards(self, points: np.ndarray) -> None:
        """One sim step in which the commanded points go to `points` (num_arms, 3) if they can."""
        way = (points - self.arms.commanded_positions()) / 0.01
        self.step(np.column_stack([way, np.full(len(way), -1.0)]))


def in_front(points: np.ndarray, distance: float) -> np.ndarray:
    """Points in the frame of an arm that stands at -Y and faces +Y, in the world frame."""
    forward, left, up = points.T
    return np.column_stack([-left, forward - distance, up])


@pytest.mark.parametrize("motion", [arm_paths.waypoints, arm_paths.lissajous])
@cases
def test_an_arm_tracks_smooth_motions_within_its_limits(case, motion):
    scene = Scene.make(case)
    arms, data = scene.arms, scene.arms.arm
    path = in_front(motion(400), data.distance)
    speeds = np.linalg.norm(np.diff(path, axis=0), axis=1) / SIM_STEP
    assert 0.8 < speeds.max() / arm_paths.SPEED < 1.01
    scene.start(path[0])
    for _ in range(10):
        scene.towards(path[:1])
    low, high = scene.model.jnt_range[scene.model.actuator_trnid[arms.servos.motors, 0]].T
    errors, torques, velocities = [], [], []
    for point in path:
        scene.towards(point[None])
        tool = arms.positions()[0]
        errors.append(np.linalg.norm(tool - point))
        torques.append(
            np.abs(motor_torques(scene.model, scene.data, arms.servos)) / data.torque_limits
        )
        velocities.append(np.abs(arms.controller.velocity) / data.velocity_limits)
        joints = scene.data.qpos[arms.servos.positions_at]
        assert np.all((low <= joints) & (joints <= high))
    assert np.mean(errors) < 0.0015
    assert np.max(errors) < 0.005
    assert np.max(torques) < 1.0
    assert np.max(velocities) < 1.0 + 1e-6
    assert arms.diagnostics()["ik_failures"] == 0
    for _ in range(50):
        scene.towards(path[-1:])
    assert np.linalg.norm(arms.positions()[0] - path[-1]) < 0.001


@arms_by_name
def test_an_unreachable_command_saturates_and_recovers(arm):
    scene = Scene.make(f"rope/{arm}")
    start = in_front(np.array([[0.45, 0.0, 0.2]]), ARMS[arm].distance)
    scene.start(start)
    low, high = scene.model.jnt_range[scene.model.actuator_trnid[scene.arms.servos.motors, 0]].T
    for direction in ([0.0, 1.0, 1.0], [1.0, 0.5, -1.0], [-1.0, -1.0, 1.0]):
        for _ in range(150):
            scene.step(np.array([[*direction, -1.0]]))
            gap = scene.arms.positions() - scene.arms.commanded_positions()
            assert np.linalg.norm(gap) < LEAD + cartesian.LEAD + 0.03
        joints = scene.data.qpos[scene.arms.servos.positions_at]
        assert np.all((low <= joints) & (joints <= high))
        for _ in range(200):
            scene.towards(start)
        assert np.linalg.norm(scene.arms.positions() - start) < 0.002
    assert scene.arms.diagnostics()["ik_failures"] == 0


@arms_by_name
def test_the_start_is_where_it_is_wanted_and_at_rest(arm):
    scene = Scene.make(f"rope/{arm}", 2)
    distance = ARMS[arm].distance
    first = np.random.default_rng(1).uniform(
        arm_paths.LOW, arm_paths.HIGH - [0.1, 0.0, 0.0], (5, 3)
    )
    for point in in_front(first, distance):
        points = np.array([point, -point * [1.0, 1.0, -1.0]])
        scene.start(points)
        np.testing.assert_allclose(scene.arms.positions(), points, atol=5e-4)
        for _ in range(20):
            scene.step(np.tile([0.0, 0.0, 0.0, -1.0], (2, 1)))
        np.testing.assert_allclose(scene.arms.positions(), points, atol=1e-3)
        # The tools point down, to a degree.
        down = scene.arms.servos.rotations()[:, 2, 2]
        assert np.all(down < -math.cos(math.radians(2.0)))


def test_another_arm_is_an_xml_and_a_record(monkeypatch, tmp_path):
    """A Franka without its third joint: nothing counts on seven."""
    franka, path = ARMS["franka"], tmp_path / "six.xml"
    tree = ElementTree.parse(franka.xml_path)
    for parent in list(tree.iter()):
        for child in parent.findall(f"*[@name='{franka.joints[2]}']"):
            parent.remove(child)
    tree.write(path)
    fields = ("joints", "home", "home_cup", "velocity_limits", "torque_limits")
    rest = {name: (*getattr(franka, name)[:2], *getattr(franka, name)[3:]) for name in fields}
    six = dataclasses.replace(franka, name="six", xml_path=str(path), **rest)
    monkeypatch.setitem(ARMS, "six", six)
    scene = Scene.make("rope/six", 2)
    points = np.array([[0.0, -0.2, 0.2], [0.0, 0.2, 0.2]])
    scene.start(points)
    goals = points + [0.1, 0.0, 0.1]
    for _ in range(100):
        scene.towards(goals)
    np.testing.assert_allclose(scene.arms.positions(), goals, atol=2e-3)
    sensed = scene.arms.proprioception()
    assert sensed.shape == (2 * (3 + 4 + 1 + 2 * 6),)
    joints = scene.data.qpos[scene.arms.servos.positions_at]
    np.testing.assert_array_equal(sensed[6:].reshape(2, -1)[:, 5:11], joints.reshape(2, 6))
    assert scene.arms.name == "six/attach"


def test_without_a_solution_the_reference_stands_still(monkeypatch):
    scene = Scene.make("rope/franka")
    scene.start(np.array([0.0, -0.2, 0.3]))
    scene.towards(np.array([[0.1, -0.2, 0.3]]))
    before = scene.arms.controller.configuration

    def fail(*args, **kwargs):
        raise mink.NoSolutionFound("daqp")

    with monkeypatch.context() as patch:
        patch.setattr(mink, "solve_ik", fail)
        for _ in range(4):
            scene.towards(np.array([[0.1, -0.2, 0.3]]))
    np.testing.assert_array_equal(scene.arms.controller.configuration, before)
    assert scene.arms.diagnostics()["ik_failures"] == 2
    for _ in range(100):
        scene.towards(np.array([[0.1, -0.2, 0.3]]))
    np.testing.assert_allclose(scene.arms.positions()[0], [0.1, -0.2, 0.3], atol=1e-3)


def controlled(arm):
    """The kinematics of an arm, and what leads it."""
    model = arm_bodies.kinematic_model(arm, (Mount((0.0, 0.0, 0.0), 0.0, 0.2, 0.8),))
    limits = zip(arm.joints, arm.velocity_limits, strict=True)
    return model, cartesian.CartesianController(
        model, [f"{arm.name}_0/tcp"], arm_bodies.home(arm),
        {f"{arm.name}_0/{joint}": limit for joint, limit in limits},
    )  # fmt: skip


# Six joints leave an elbow no choice.
@pytest.mark.parametrize("arm", [name for name, arm in ARMS.items() if len(arm.joints) > 6])
def test_an_elbow_swings_home_slowly_and_the_tool_stays(arm):
    """Displaced along the null space, it comes back by the same share in each solution."""
    model, controller = controlled(ARMS[arm])
    data, home = mujoco.MjData(model), controller.home
    data.qpos[:] = home
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    jacobian = np.empty((6, model.nv))
    mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], model.site(f"{arm}_0/tcp").id)
    swing = 0.05 * np.linalg.svd(jacobian)[2][-1]  # [rad]
    controller.set_state(controller.get_state() | {"configuration": home + swing})
    point, away = controller.points(), []
    for _ in range(60):
        controller.follow_points(point)
        assert np.abs(controller.velocity).max() < 0.05 / (15 * cartesian.PERIOD)
        away.append((controller.configuration - home) @ swing / (swing @ swing))
    weight = cartesian.POSTURE_COST**2
    share = cartesian.POSTURE_GAIN * weight / (weight + cartesian.DAMPING)
    np.testing.assert_allclose(away, (1.0 - share) ** np.arange(1, 61), atol=0.01)
    assert np.linalg.norm(controller.points() - point) < 1e-3


def test_the_controller_clips_what_is_outside_the_limits():
    model, controller = controlled(ARMS["franka"])
    state = controller.get_state()
    controller._place(model.jnt_range[:, 1] + 0.1)
    assert np.all(controller.configuration < model.jnt_range[:, 1])
    controller.follow_points(np.array([[0.5, 0.0, 0.3]]))
    assert controller.failures == 0
    controller.set_state(state)
    np.testing.assert_array_equal(controller.configuration, controller.home)


def test_mounts_clip_to_half_a_ring():
    (mount,) = facing_each_other(1, 0.6, 0.25, 0.75)
    # In front of the base at (0, -0.6), nearer than 0.25 m, further than 0.75 m, behind it, above.
    np.testing.assert_allclose(mount.clip(np.array([0.1, -0.1, 0.3])), [0.1, -0.1, 0.3])
    np.testing.assert_allclose(mount.clip(np.array([0.0, -0.5, 0.3])), [0.0, -0.35, 0.3])
    np.testing.assert_allclose(
        mount.clip(np.array([0.6, 0.2, 0.15])), [0.45, 0.0, 0.15], atol=1e-12
    )
    behind = mount.clip(np.array([0.5, -1.0, 0.3]))
    assert math.dist(behind[:2], (0.0, -0.6)) == pytest.approx(math.hypot(0.5, 0.05))
    assert behind[1] > -0.6
    above = mount.clip(np.array([0.0, 0.6, 0.6]))
    np.testing.assert_allclose(above, [0.0, 0.0, 0.6], atol=1e-12)  # 0.6 along, 0.45 up.
    assert mount.farthest(0.15) == 0.75 and mount.farthest(0.6) == pytest.approx(0.6)
    mirrored = facing_each_other(2, 0.6, 0.25, 0.75)[1]
    np.testing.assert_allclose(
        mirrored.clip(np.array([-0.6, -0.2, 0.15])), [-0.45, 0.0, 0.15], atol=1e-12
    )


def test_mounts_know_where_their_reach_ends():
    """A clipped point lies at the end of the reach, as does none that can be moved either way."""
    (mount,) = facing_each_other(1, 0.6, 0.25, 0.75, height=0.3)
    random = np.random.default_rng(0)
    clipped = 0
    for point in random.uniform([-1.0, -1.2, 0.0], [1.0, 0.6, 1.2], (2000, 3)):
        there = mount.clip(point)
        if np.abs(there - point).max() > 1e-12:
            clipped += 1
            assert mount.at_end(point) and mount.at_end(there)
        else:
            around = there + 1e-3 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
            moved = max(np.abs(mount.clip(near) - near).max() for near in around)
            assert not mount.at_end(point) or moved > 1e-12
    assert 500 < clipped < 1900
