"""Arms that hold by friction alone: scripts pinch cloth and rope by actions as agents take them."""

import numpy as np
import pytest

import softgym_mj
from softgym_mj.entities import Cloth
from softgym_mj.envs.environment import Environment
from softgym_mj.tasks import Measures, Task
from tests.contract.test_contract import actions
from tests.contract.test_snapshots import trace
from tests.robots.arms import arms_of
from tests.scenes.grasping import (
    FAR,
    VARIATIONS,
    close_at,
    edge_place,
    go,
    lift_and_carry,
    wait,
)  # fmt: skip


def load(task, arm, **settings):
    """An environment with arms that hold by friction."""
    return softgym_mj.load(
        task, actor=arm, grasp="friction", split="evaluate", horizon=1000, **settings
    )


def pinch_edge(env):
    """Pinches an edge of the cloth; returns the vertex nearest to the tool."""
    close_at(env, edge_place(env))
    offsets = env.task.objects[0].displacements_from(env.task.actor.positions()[0])
    return int(np.linalg.norm(offsets, axis=1).argmin())


def offset(env, vertex):
    """Returns a vertex relative to the tool point (3,) [m]."""
    return env.task.objects[0].vertex(vertex) - env.task.actor.positions()[0]


def carries(arm, variation):
    """Whether an edge is pinched, lifted and carried, and let go when the fingers open."""
    env = load("fold_cloth", arm, arms=1)
    env.reset(variation)
    actor, target, mass = env.task.actor, env.task.objects[0], env.physics.model.dof_M0.copy()
    vertex = pinch_edge(env)
    pinched = offset(env, vertex)
    lift_and_carry(env)
    wait(env, True, 12)
    drift = np.linalg.norm(offset(env, vertex) - pinched)
    height = target.vertex(vertex)[2]
    opening = env.physics.data.qpos[actor.servos.fingers.positions_at[0]].sum()
    # Cloth is between the pads: of its 4 mm, they leave some.
    held = drift < 0.05 and height > 0.15 and opening > 0.001 and actor.held[0] >= 0
    np.testing.assert_array_equal(env.physics.model.dof_M0, mass)
    wait(env, False, 6)
    assert actor.held[0] == -1
    go(env, actor.commanded_positions()[0] + [0.0, 0.0, 0.15], False, 0.4)
    # What is let go of may stay where it is, as a tent on the floor: the hand rises without it.
    return held and offset(env, vertex)[2] < -0.12


@arms_of("franka")
def test_an_edge_of_a_cloth_is_lifted_carried_and_let_go(arm):
    assert carries(arm, 804)


@arms_of()
def test_edges_are_held_in_nearly_every_variation(arm):
    assert sum(carries(arm, variation) for variation in VARIATIONS) >= 8


@arms_of("franka")
def test_without_friction_nothing_is_lifted(arm):
    env = load("fold_cloth", arm, arms=1)
    env.reset(802)
    pads = env.task.actor._holding._fingers.pads
    env.physics.model.ptr.geom_friction[pads] = 1e-5
    vertex = pinch_edge(env)
    lift_and_carry(env)
    assert env.task.objects[0].vertex(vertex)[2] < 0.05
    assert env.task.actor.held[0] == -1


@arms_of("franka")
def test_a_restore_continues_bit_equal_while_something_is_held(arm):
    env = load("fold_cloth", arm, arms=1, observation="full")
    env.reset(800)
    pinch_edge(env)
    go(env, env.task.actor.commanded_positions()[0] + [0.0, 0.0, 0.1], True, 0.3)
    assert env.task.actor.held[0] >= 0
    act = actions(env, 8, seed=1)
    act[:4, 3], act[4:6, 3] = 1.0, -1.0  # Holds, lets go, closes by chance.
    snapshot = env.get_state()
    expected, info = trace(env, act), env.info()
    assert info["dropped"] > 0
    env.set_state(snapshot)
    np.testing.assert_array_equal(trace(env, act), expected)
    other = load("fold_cloth", arm, arms=1, observation="full")
    other.reset(803)
    trace(other, act[:2])
    other.set_state(snapshot)
    assert other.task.actor.held[0] == snapshot.task["actor"]["held"][0]
    np.testing.assert_array_equal(trace(other, act), expected)
    assert env.info() == other.info() == info


@arms_of("sawyer")
def test_a_piece_of_a_rope_is_lifted(arm):
    env = load("straighten_rope", arm, arms=1)
    env.reset(800)
    actor, target = env.task.actor, env.task.objects[0]
    vertices = target.points()
    along = np.gradient(vertices, axis=0)
    across = np.abs(along[:, 1]) / np.linalg.norm(along, axis=1)
    reach = np.linalg.norm((vertices - actor.mounts[0].base)[:, :2], axis=1)
    across[[*range(3), *range(-3, 0)]] = 0.0  # An end would slip out.
    vertex = int(np.where(reach < FAR, across, 0.0).argmax())
    close_at(env, vertices[vertex, :2])
    assert actor.held[0] == vertex
    pinched = offset(env, vertex)
    lift_and_carry(env)
    wait(env, True, 12)
    assert actor.held[0] == vertex
    assert np.linalg.norm(offset(env, vertex) - pinched) < 0.005
    wait(env, False, 6)
    assert offset(env, vertex)[2] < -0.1


class Lift(Task):
    """A rigid body of one's own within reach, a cloth 0.3 m away from it."""

    def __init__(self, shape):
        self.cloth = Cloth(dims=(20, 20), fidelity="fast")
        super().__init__([self.cloth], actor="franka", arms=1, grasp="friction")
        body = self.root_entity.mjcf_model.worldbody.add("body", name="toy", pos=[0.1, -0.2, 0.02])
        body.add("freejoint")
        size = [0.018] * 3 if shape == "box" else [0.018]
        body.add(
            "geom", name="toy", type=shape, size=size, mass=0.05, condim=4, conaffinity=3
        )  # Solid for hands, too.

    def arrange(self, random):
        self.cloth.set_points(self.cloth.flat((-0.2, -0.2)))

    def measure(self, state, episode):
        return Measures(0.0, {"nothing": 0.0})


@pytest.mark.parametrize("shape", ["box", "sphere"])
def test_a_rigid_body_in_the_hand_is_no_vertex(shape):
    env = Environment(Lift(shape), name="lift", horizon=1000)
    env.reset(800)
    close_at(env, np.array([0.1, -0.2]))
    data = env.physics.data.ptr
    # The geom of the simpler kind comes first: a ball before the pad, the pad before a
    # box.
    pads = env.task.actor._holding._fingers.pads
    place = 1 if shape == "sphere" else 0
    assert set(np.ravel(pads)) <= set(data.contact.geom[:, place])
    held = []
    for _ in range(20):
        env.step(np.array([0.0, 0.0, 0.1, 1.0]))
        held.append(env.task.actor.held[0])
    assert data.body("toy").xpos[2] > 0.1
    assert set(held) == {-1} and env.info()["picks_held"] == env.info()["dropped"] == 0


@arms_of("sawyer")
def test_a_hanging_cloth_is_held_from_the_start(arm):
    env = load("drop_cloth", arm)
    env.reset(806)
    actor, target = env.task.actor, env.task.objects[0]
    corners = actor.held
    start = target.points()[corners] - actor.positions()
    for way in (0.6, -0.6):
        for _ in range(5):
            env.step(np.tile([way, 0.0, 0.1, 1.0], 2))
    drift = target.points()[corners] - actor.positions() - start
    assert np.linalg.norm(drift, axis=1).max() < 0.02
    assert np.all(actor.held >= 0)
    wait(env, False, 4)
    fallen = actor.positions() - target.points()[corners]
    assert fallen[:, 2].min() > 0.1


@arms_of("franka", "sawyer")
def test_fingers_get_down_beside_a_sheet_and_not_into_the_floor(arm):
    env = load("straighten_rope", arm, arms=1)
    env.reset(800)
    actor, physics = env.task.actor, env.physics
    x, y = actor.positions()[0][:2]
    go(env, np.array([x, y, actor.limits[0][2]]), False, 0.2)
    pads = [f"arms/{arm}_0/{pad}" for pad in actor.arm.pad_geoms]
    tips = [physics.named.data.geom_xpos[p][2] - physics.named.model.geom_size[p][2] for p in pads]
    assert 0.0 < min(tips) < 0.005
    assert env.info()["ik_failures"] == 0


@pytest.mark.long
@arms_of("sawyer")
def test_random_actions_leave_the_simulation_sound(arm):
    env = load("fold_cloth", arm, fidelity="fast")
    actor, target, held = env.task.actor, env.task.objects[0], 0
    for trial in range(2):  # Contacts multiply what differs in a last bit: no single course counts.
        env.reset(805)
        random, noise = np.random.default_rng(5), np.random.default_rng(trial)
        for i in range(30):
            if i % 5 == 0:  # Downwards and closed more often than not.
                action = random.uniform(-1.5, 1.5, 8) - np.tile([0, 0, 0.6, -0.8], 2)
            env.step(np.clip(action, -1, 1) * (1.0 - noise.uniform(0.0, 1e-12, 8)))
            held += np.count_nonzero(actor.held >= 0)
            assert np.abs(target.edge_strain()).max() < 2.0  # Seen: 1.1.
        info = env.info()
        assert info["physics_warnings"] == info["ik_failures"] == 0
    assert held > 0
