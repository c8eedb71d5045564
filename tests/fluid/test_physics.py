"""The water behaves like water: at rest, shaken, on a balance, in free flight."""

import mujoco
import numpy as np
import pytest

from softgym_mj import assets
from softgym_mj.native.library import load_plugin
from tests.oracles import fluid
from tests.scenes.fluid_cup import SPACING, FluidCup

SHAPES = {
    mujoco.mjtGeom.mjGEOM_PLANE: "plane",
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
}
OBSTACLES = """
<geom type="sphere" size=".03" pos="0.02 0 .06" contype="0" conaffinity="0"/>
<geom type="capsule" size=".02 .03" pos="-.03 .03 .05" euler="20 14 0" contype="0" conaffinity="0"/>
<geom type="cylinder" size=".03 .02" pos=".05 .05 .05" euler="40 21 0" contype="0" conaffinity="0"/>
<geom type="ellipsoid" size=".04 .03 .02" pos="-.05 -.05 .04" euler="0 30 9" contype="0"
      conaffinity="0"/>"""
PLANE = '<geom type="plane" size="1 1 1" pos="0 0 -.02"/>'


def wall_poses(cup):
    mujoco.mj_kinematics(cup.model, cup.data)
    poses = []
    for geom in range(cup.model.ngeom):
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, cup.data.geom_xmat[geom])
        poses.append(fluid.Pose(cup.data.geom_xpos[geom].copy(), quaternion))
    return poses


def test_a_step_is_that_of_the_reference():
    """All shapes, moving and turning, with viscosity, cohesion and friction."""
    settings = {"viscosity": 3e-4, "cohesion": 1.5, "friction": 0.2}
    cup = FluidCup((6, 6), 5, inside=OBSTACLES, scenery=PLANE, substeps=4, **settings)
    liquid = fluid.Fluid(spacing=SPACING, substeps=4, **settings)
    cup.step()
    turn = np.array([0.5, 1.0, 0.3])
    for step in range(17):
        start, x, v = wall_poses(cup), cup.positions.copy(), cup.velocities.copy()
        cup.data.mocap_pos[0] += [0.004, 0.002, 0.001]
        quaternion = cup.data.mocap_quat[0].copy()
        mujoco.mju_quatIntegrate(quaternion, turn, 0.01)
        cup.data.mocap_quat[0] = quaternion
        end = wall_poses(cup)
        cup.step()
        if step in (8, 16):
            kinds = [SHAPES[int(kind)] for kind in cup.model.geom_type]
            walls = list(map(fluid.Wall, kinds, cup.model.geom_size, start, end))
            gravity = cup.model.opt.gravity
            expected_x, expected_v, _ = fluid.step(liquid, 0.01, gravity, walls, x, v)
            np.testing.assert_allclose(cup.positions, expected_x, rtol=0, atol=2e-6)
            np.testing.assert_allclose(cup.velocities, expected_v, rtol=0, atol=5e-4)
            assert np.abs(expected_v).max() > 0.3  # Something happens.


@pytest.mark.parametrize(
    ("columns", "layers", "spacing", "most", "speed"),
    [
        ((8, 8), 18, SPACING, 1.05, 0.005),
        ((8, 8), 18, 0.005, 1.05, 0.005),
        ((8, 8), 18, 0.05, 1.05, 0.02),
        pytest.param((13, 13), 24, SPACING, 1.06, 0.01, marks=pytest.mark.slow),
        pytest.param((13, 13), 52, SPACING, 1.08, 0.01, marks=pytest.mark.slow),
    ],
)
def test_a_column_comes_to_rest_at_its_height(columns, layers, spacing, most, speed):
    """Times scale with the square root of the spacing, viscosity with its power of 3/2."""
    cup = FluidCup(columns, layers, spacing=spacing, viscosity=2e-4 * (spacing / SPACING) ** 1.5)
    energies = []
    for _ in range(6):
        cup.step(50)
        energies.append(cup.speed() ** 2)
    z = cup.positions[:, 2]
    # Twice the mean height, which stray particles at the top do not change.
    assert 2 * z.mean() == pytest.approx(layers * spacing, rel=0.05)
    assert z.max() + spacing / 2 == pytest.approx(layers * spacing, rel=0.05)
    assert fluid.compression(cup.positions, spacing).max() < most
    assert cup.speed() < speed
    assert energies[-1] < 0.05 * energies[0]


def test_mechanical_energy_decays():
    """Stirred at random, a column only loses kinetic and potential energy."""
    cup = FluidCup((6, 6), 6, wall=0.3, height=0.6)
    cup.velocities[:] = np.random.default_rng(0).normal(0, 0.5, (cup.count, 3))
    energies = []
    for _ in range(200):
        cup.step()
        kinetic = 0.5 * (cup.velocities**2).sum()
        energies.append(kinetic + 9.81 * cup.positions[:, 2].sum())
    energies = np.array(energies)
    assert (np.diff(energies) < 0.02 * (energies[0] - energies[-1])).all()
    assert energies[-1] < energies[0]


def shake(cup, speed, seconds):
    """Square waves along both axes, with sudden stops and reversals."""
    random = np.random.default_rng(0)
    velocity = np.zeros(3)
    escaped = np.zeros(cup.count, bool)
    cup.step()
    for step in range(int(seconds / 0.01)):
        if step % 37 == 0:
            along_x, along_y = np.array([speed, 0, 0]), np.array([0, speed, 0])
            velocity = [along_x, -velocity, 0 * along_x, along_y, -along_x, -along_y][
                random.integers(6)
            ]
        cup.data.mocap_pos[0] += 0.01 * velocity
        cup.step()
        escaped |= cup.escaped()
    return escaped


@pytest.mark.parametrize("wall", [0.01, 0.002])
@pytest.mark.parametrize("speed", [0.66, 2.0])
@pytest.mark.parametrize(
    ("columns", "layers", "seconds"),
    [
        ((6, 6), 12, 3),
        pytest.param((6, 6), 12, 10, marks=pytest.mark.slow),
        pytest.param((8, 8), 18, 10, marks=pytest.mark.slow),
        pytest.param((13, 13), 24, 10, marks=pytest.mark.slow),
        pytest.param((13, 13), 52, 10, marks=pytest.mark.slow),
    ],
)
def test_no_particle_gets_through_a_wall(wall, speed, columns, layers, seconds):
    cup = FluidCup(columns, layers, wall=wall, height=12.0)  # So tall that nothing overtops.
    assert not shake(cup, speed, seconds).any()
    assert cup.positions[:, 2].max() < 11
    assert np.isfinite(cup.state).all()


def test_no_particle_gets_through_a_tumbling_closed_box():
    lid = '<geom type="box" pos="0 0 .26" size=".064 .064 .002" contype="0" conaffinity="0"/>'
    cup = FluidCup((6, 6), 10, wall=0.002, height=0.258, inside=lid)
    turn = np.array([2.0, 3.0, 1.0])
    for step in range(200):
        quaternion = cup.data.mocap_quat[0].copy()
        mujoco.mju_quatIntegrate(quaternion, turn if step < 100 else -turn, 0.01)
        cup.data.mocap_quat[0] = quaternion
        cup.step()
    inverse, matrix = np.zeros(4), np.zeros(9)
    mujoco.mju_negQuat(inverse, cup.data.mocap_quat[0])
    mujoco.mju_quat2Mat(matrix, inverse)
    local = cup.positions @ matrix.reshape(3, 3).T
    assert (np.abs(local[:, :2]) < cup.length / 2).all()
    assert (local[:, 2] > 0).all() and (local[:, 2] < 0.258).all()


@pytest.mark.parametrize(("kp", "kv"), [(40000, 2000), (4000, 400)])
def test_a_balance_shows_the_weight_of_the_water(kp, kv):
    cup = FluidCup(
        (8, 8), 8, body="", joint='<joint name="z" type="slide" axis="0 0 1"/>',
        actuator=f'<actuator><position joint="z" kp="{kp}" kv="{kv}"/></actuator>',
        option='integrator="implicitfast"', two_way="true",
    )  # fmt: skip
    cup.step(300)
    forces = []
    for _ in range(100):
        cup.step()
        forces.append(cup.data.actuator_force[0])
    water = 1000 * SPACING**3 * cup.count
    expected = 9.81 * (water + cup.model.body_mass.sum())
    assert np.mean(forces) == pytest.approx(expected, rel=0.001)
    assert np.std(forces) < 0.001 * expected


def momentum_lost_by_a_box_in_free_flight(mass, seed):
    """Share of its momentum that a turning box of water of `mass` [kg] loses in 3 s."""
    height = 6 * SPACING * 1.3
    inertia = 0.01 * mass
    cup = FluidCup(
        (6, 6), 6, height=height, base=-height / 2, body="", option='gravity="0 0 0"',
        joint='<freejoint/>'
        f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>',
        inside=f'<geom type="box" pos="0 0 {height / 2 + 0.005}" size=".064 .064 .005" '
        'contype="0" conaffinity="0"/>',
        two_way="true", corner=f"-0.045 -0.045 {SPACING / 2}",
    )  # fmt: skip
    cup.data.qvel[:] = [1.0, 0.5, 0.2, 1.0, 2.0, 3.0]
    cup.positions[:] += np.random.default_rng(seed).normal(scale=1e-7, size=cup.positions.shape)
    particle = 1000 * SPACING**3
    walls, dt = cup.model.ngeom, cup.model.opt.timestep

    def momentum():
        # What the walls took up and have not yet handed over to the body is under way.
        forces, pending = cup.state[-12 * walls :].reshape(2, walls, 6)
        under_way = (dt * forces + pending)[:, :3].sum(axis=0)
        return mass * cup.data.qvel[:3] + particle * cup.velocities.sum(axis=0) + under_way

    before = momentum()
    np.testing.assert_allclose(before, mass * np.array([1.0, 0.5, 0.2]))
    cup.step(300)
    water = particle * cup.velocities.sum(axis=0)
    assert np.linalg.norm(water) > 0.05 * np.linalg.norm(before)  # It was taken along.
    return np.linalg.norm(momentum() - before) / np.linalg.norm(before)


@pytest.mark.parametrize("mass", [0.3, 1.0, 10.0])
def test_a_box_of_water_in_free_flight_keeps_its_momentum(mass):
    """The water is 1.26 kg: the box is lighter, about equal and heavier.

    A particle that is pushed further than the limit of a substep's corrections loses what is beyond
    it. In the lightest box that happens in one run of six or so.
    """
    lost = [momentum_lost_by_a_box_in_free_flight(mass, seed) for seed in range(3)]
    assert np.median(lost) < 1e-5
    assert max(lost) < 0.01


@pytest.fixture(name="settled", scope="module")
def _settled():
    """Positions of water at rest, and how long its cup is [m]."""
    cup = FluidCup((16, 16), 10)
    cup.step(200)
    return cup.positions, cup.length


@pytest.mark.parametrize("viscosity", [2e-5, 2e-4, 2e-3])
def test_viscosity_is_the_kinematic_viscosity(settled, viscosity):
    """A shear wave v_y = sin(k x) decays at the rate viscosity * k^2."""
    x, length = settled
    k = np.pi / length
    core = (np.abs(x[:, :2]) < 0.08).all(axis=1) & (np.abs(x[:, 2] - 0.09) < 0.04)
    wave = np.sin(k * x[:, 0])
    after = []
    for setting in (viscosity, 0):  # The step ends with viscosity: all before it is the same.
        cup = FluidCup((16, 16), 10, viscosity=setting, option='gravity="0 0 0"')
        cup.positions[:] = x + [0, 0, 5]  # No walls: they would turn the shear into an eddy.
        cup.velocities[:] = 0
        cup.velocities[:, 1] = 0.5 * wave  # Far above what the water does by itself.
        cup.step()
        after.append((cup.velocities[core, 1] * wave[core]).sum())
    rate = np.log(after[1] / after[0]) / 0.01
    assert rate == pytest.approx(viscosity * k**2, rel=0.1)


def test_cohesion_pulls_a_cloud_together():
    spread = {}
    for cohesion in (0, 5):
        cup = FluidCup((6, 6), 6, cohesion=cohesion, viscosity=1e-3, option='gravity="0 0 0"')
        cup.positions[:] = 1.3 * cup.positions + [0, 0, 1]  # Far from the walls.
        cup.step(100)
        offset = cup.positions - cup.positions.mean(axis=0)
        spread[cohesion] = np.sqrt((offset**2).sum(axis=1).mean())
        # Pairs pull equally: the center stays.
        np.testing.assert_allclose(cup.velocities.mean(axis=0), 0, atol=1e-5)
    assert spread[5] < 0.9 * spread[0]


def test_a_cork_floats_and_a_stone_sinks():
    """The example model. A quarter of the cork is under water; the stone lies on the bottom."""
    load_plugin()
    model = mujoco.MjModel.from_xml_path(str(assets.path("water_tank.xml")))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 600)
    particles = data.plugin_state[1 : 1 + 3 * 3000].reshape(-1, 3)
    spacing, radius = 0.02, 0.05
    level = np.percentile(particles[:, 2], 98) + spacing / 2
    # A cap of height h has a quarter of the ball's volume where h^2 (3 r - h) = r^3.
    depths = np.roots([-1, 3 * radius, 0, -(radius**3)])
    depth = depths[(depths > 0) & (depths < 2 * radius)][0].real
    assert data.body("cork").xpos[2] == pytest.approx(level - depth + radius, abs=0.6 * spacing)
    assert data.body("stone").xpos[2] == pytest.approx(0.02 + 0.04, abs=0.003)
    assert np.linalg.norm(data.qvel[:3]) < 0.02
    weight = 9.81 * model.body("cork").mass[0]
    assert data.qfrc_passive[2] == pytest.approx(weight, rel=0.02)


def test_buoyancy_of_a_ball():
    """Held under water, it is a tenth below Archimedes: see the limits in the plugin's README."""
    body = (
        '<body name="held" pos="0 0 0.13"><joint name="z" type="slide" axis="0 0 1"/>'
        '<geom type="sphere" size="0.05" density="1000" contype="0" conaffinity="0"/>'
        '<plugin instance="water"/></body>'
    )
    cup = FluidCup(
        (12, 12), 13, height=0.6, two_way="true", scenery=body, option='integrator="implicitfast"',
        actuator='<actuator><position joint="z" kp="100000" kv="3000"/></actuator>',
    )  # fmt: skip
    displaced = np.linalg.norm(cup.positions - [0, 0, 0.13], axis=1) < 0.06
    cup.positions[displaced, 2] += 0.25
    cup.step(250)
    forces = []
    for _ in range(100):
        cup.step()
        forces.append(cup.data.qfrc_passive[0])
    archimedes = 9.81 * cup.model.body("held").mass[0]
    assert 0.85 * archimedes < np.mean(forces) < 1.05 * archimedes
