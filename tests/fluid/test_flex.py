"""Cloth and ropes hold water back: against the numpy twin, and physically."""

import re

import mujoco
import numpy as np
import pytest

from softgym_mj.fluid.water import Liquid, Resolution, Water
from softgym_mj.native.library import load_plugin
from tests.fluid.test_physics import wall_poses
from tests.oracles import fluid, fluid_flexes
from tests.scenes.fluid_cup import SPACING, cup_geoms

CONTACT = fluid.CONTACT * SPACING  # Beyond the flex's radius.
RADIUS = 0.005
NEAR = 2e-5  # [m] What single precision leaves of a distance.
# A frame that is driven by its velocity, and any number of things in it.
SLIDES = (
    '<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>'
    '<joint type="slide" axis="0 0 1"/>'
    '<inertial mass="1000" pos="0 0 0" diaginertia="100 100 100"/>'
)


# As soft as the other; what hangs in the air does not swing up and down for long.
SOFT = {"stretch": 100, "stretch_damping": 0.01, "drag": 1.2}
PLUGIN = '<plugin plugin="softgym_mj.cloth"><instance name="cloth">{}</instance></plugin>'.format(
    "".join(f'<config key="{key}" value="{value}"/>' for key, value in SOFT.items())
)


def cloth(
    count, spacing, pins=(), *, pos="0 0 0", radius=RADIUS, young=2e5, mass=0.05, euler="0 0 0",
    mover="mujoco",
):  # fmt: skip
    """A cloth with MuJoCo's elasticity, or one that the cloth plugin moves."""
    pin = f'<pin id="{" ".join(map(str, pins))}"/>' if len(pins) else ""
    if mover == "plugin":
        touches, made_of = 'conaffinity="0"', '<edge damping="1e-12"/><plugin instance="cloth"/>'
    else:
        touches = 'conaffinity="1" gap="0.003"'
        made_of = f"""<elasticity young="{young}" poisson="0.2" thickness="5e-4" damping="0.01"
          elastic2d="both"/>"""
    return f"""<flexcomp name="cloth" type="grid" dim="2" count="{count} {count} 1" mass="{mass}"
      spacing="{spacing} {spacing} {spacing}" radius="{radius}" pos="{pos}" euler="{euler}">
      <contact selfcollide="none" contype="0" {touches}/>{pin}{made_of}</flexcomp>"""


def rope(count, spacing, pins=(), *, pos="0 0 0", radius=0.006, euler="0 0 0"):
    pin = f'<pin id="{" ".join(map(str, pins))}"/>' if len(pins) else ""
    return f"""<flexcomp name="rope" type="grid" dim="1" count="{count} 1 1" mass="0.02"
      spacing="{spacing} 0.02 0.02" radius="{radius}" pos="{pos}" euler="{euler}">
      <contact selfcollide="none" contype="0" conaffinity="1" gap="0.003"/>{pin}
      <edge equality="true" solref="-24000 -200" solimp="0.99 0.999 0.001"/>
      <elasticity young="1e4" damping="0.01"/></flexcomp>"""


def rim(count):
    return [i for i in range(count**2) if {i // count, i % count} & {0, count - 1}]


def corners(count):
    return [0, count - 1, count * (count - 1), count**2 - 1]


class FlexScene:
    """A column of water whose lowest layer is at z = `height`, and whatever `world` has."""

    def __init__(
        self, world, columns, layers, height, *, flexes="true", option="", cloth_first=True,
        **config,
    ):  # fmt: skip
        load_plugin()
        nx, ny = columns
        self.count = nx * ny * layers
        attributes = {
            "count": self.count,
            "spacing": SPACING,
            "columns": f"{nx} {ny}",
            "corner": f"{-(nx - 1) * SPACING / 2} {-(ny - 1) * SPACING / 2} {height}",
            "flexes": flexes,
            **config,
        }
        keys = "".join(f'<config key="{k}" value="{v}"/>' for k, v in attributes.items())
        plugins = 2 * [PLUGIN] if 'instance="cloth"' in world else ["", ""]
        plugins[cloth_first] = ""
        self.xml = f"""
        <mujoco><option timestep="0.01" integrator="discrete" solver="CG" jacobian="sparse"
          cone="elliptic" iterations="100" tolerance="1e-4" {option}/>
        <extension>{plugins[0]}<plugin plugin="softgym_mj.fluid"><instance name="water">{keys}
        </instance></plugin>{plugins[1]}</extension><worldbody>{world}</worldbody></mujoco>"""
        self.model = mujoco.MjModel.from_xml_string(self.xml)
        self.data = mujoco.MjData(self.model)
        self.instance = mujoco.mj_name2id(self.model, mujoco.mjtObj.mjOBJ_PLUGIN, "water")
        self.positions, self.velocities = particles(
            self.data, self.count, self.model.plugin_stateadr[self.instance]
        )

    def step(self, count=1):
        mujoco.mj_step(self.model, self.data, count)

    def flexes(self, start, end):
        """The model's flexes for the numpy twin, with vertices (n, 3) at `start` and `end`."""
        m, elements, radius = self.model, [], []
        for flex in range(m.nflex):
            corners = m.flex_dim[flex] + 1
            first, count = m.flex_elemdataadr[flex], m.flex_elemnum[flex]
            index = m.flex_elem[first : first + corners * count].reshape(-1, corners)
            elements.append(index[:, [0, 1, corners - 1]] + m.flex_vertadr[flex])
            radius += count * [m.flex_radius[flex]]
        return fluid_flexes.Flexes(np.concatenate(elements), np.array(radius), start, end)

    def points(self):
        """(n, 3) where MuJoCo's own kinematics has them."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_flex(self.model, self.data)
        return self.data.flexvert_xpos.copy()

    def nearest(self, positions):
        """Distances (n,) to the flexes' mid lines and surfaces, and on which side (n,) of these."""
        x = self.points()
        corners = self.flexes(x, x).at(0)
        points = np.repeat(positions, len(corners), axis=0)
        every = np.tile(corners, (len(positions), 1, 1))
        weights, lengths = fluid_flexes.closest(points, every)
        lengths = lengths.reshape(len(positions), -1)
        pick = np.arange(len(positions)) * len(corners) + lengths.argmin(axis=1)
        a, b, c = every[pick].swapaxes(0, 1)
        offset = points[pick] - np.einsum("mk,mkd->md", weights[pick], every[pick])
        side = np.sign((offset * np.cross(b - a, c - a)).sum(axis=1))
        return lengths.min(axis=1), side


def particles(data, count, first=0):
    """Positions and velocities (count, 3), views, of an instance whose state begins at `first`."""
    state = data.plugin_state[first + 1 : first + 1 + 6 * count].reshape(2, count, 3)
    return state[0], state[1]


# ---------------------------------------------------------------------- against numpy


def test_nearest_points_are_the_nearest_of_many():
    random = np.random.default_rng(0)
    triangles = random.normal(size=(30, 3, 3))
    triangles[20:, 2] = triangles[20:, 1]  # Segments.
    steps = np.arange(101) / 100
    u, v = (a[steps[:, None] + steps <= 1] for a in np.meshgrid(steps, steps))
    many = np.column_stack([1 - u - v, u, v])
    for point in random.normal(size=(20, 3)):
        weights, distance = fluid_flexes.closest(point, triangles)
        sampled = np.linalg.norm(point - many @ triangles, axis=2).min(axis=1)
        assert (distance <= sampled + 1e-12).all() and (sampled - distance < 0.05).all()
        assert (weights > -1e-12).all() and np.allclose(weights.sum(axis=1), 1)
        reached = np.linalg.norm(point - np.einsum("mk,mkd->md", weights, triangles), axis=1)
        np.testing.assert_allclose(reached, distance, atol=1e-12)


@pytest.mark.parametrize("speed", [0.4, 1.6])
def test_lone_particles_are_stopped_where_they_touch(speed):
    """On their way to the nearest point of a tilted triangle or segment, from all around it."""
    for world, elements in (
        (cloth(2, 0.1, range(4), euler="20 30 40"), 2),
        (rope(2, 0.1, range(2), euler="20 30 40"), 1),
    ):
        still = 'gravity="0 0 0"'
        scene = FlexScene(world, (1, 1), 1, 0.2, option=still, viscosity=0, substeps=1, friction=0)
        hold = scene.model.flex_radius[0] + CONTACT
        x = scene.points()
        corners = scene.flexes(x, x).at(0)
        assert len(corners) == elements
        for point in np.random.default_rng(1).uniform(-0.1, 0.1, (100, 3)):
            weights, lengths = fluid_flexes.closest(point, corners)
            e = lengths.argmin()
            foot = weights[e] @ corners[e]
            direction = (point - foot) / lengths[e]
            scene.positions[0] = foot + (hold + 0.001) * direction
            scene.velocities[0] = -speed * direction
            scene.step()
            if speed > 1 and elements == 2 and weights[e].min() <= 0:
                # So fast that it would pass, at the rim: it may end on either side of it.
                assert scene.nearest(scene.positions)[0] > hold - NEAR
                continue
            np.testing.assert_allclose(scene.positions[0], foot + hold * direction, atol=NEAR)
            np.testing.assert_allclose(scene.velocities[0], -0.1 * direction, atol=1e-3)


def test_a_step_is_that_of_the_reference():
    """A cloth and a rope that move, a plane; viscosity, cohesion and friction; a jet meets them."""
    settings = {"viscosity": 3e-4, "cohesion": 1.5, "friction": 0.2}
    world = (
        '<geom type="plane" size="1 1 1" contype="0" conaffinity="1"/>'
        + cloth(4, 0.05, corners(4)[:2], pos="0 0 0.08")
        + rope(5, 0.03, pos="0 0.02 0.11")
    )
    scene = FlexScene(world, (4, 4), 4, 0.13, substeps=3, **settings)
    liquid = fluid.Fluid(spacing=SPACING, substeps=3, **settings)
    scene.velocities[:, 2] = -2.0
    random = np.random.default_rng(0)
    touched = 0
    for step in range(10):
        scene.data.qvel[:] += random.normal(0, 0.3, scene.model.nv)
        start, x, v = scene.points(), scene.positions.copy(), scene.velocities.copy()
        (plane,) = wall_poses(scene)
        scene.step()
        if step not in (3, 9):
            continue
        flexes = scene.flexes(start, scene.points())
        walls = [fluid.Wall("plane", np.ones(3), plane, plane)]
        gravity = scene.model.opt.gravity
        expected_x, expected_v, _ = fluid.step(liquid, 0.01, gravity, walls, x, v, flexes)
        np.testing.assert_allclose(scene.positions, expected_x, rtol=0, atol=2e-6)
        np.testing.assert_allclose(scene.velocities, expected_v, rtol=0, atol=5e-4)
        free_x, _, _ = fluid.step(liquid, 0.01, gravity, walls, x, v)
        touched += (np.abs(free_x - expected_x).max(axis=1) > 1e-4).sum()
    assert touched > 50  # Something happens.


# ---------------------------------------------------------------------- nothing gets through


def test_a_jet_does_not_get_through_a_cloth_on_the_floor():
    world = '<geom type="plane" size="1 1 1"/>' + cloth(10, 0.04, pos="0 0 0.006", mover="plugin")
    scene = FlexScene(world, (5, 5), 12, 0.05)
    scene.velocities[:, 2] = -3.0
    for _ in range(40):
        scene.step()
        inside = (np.abs(scene.positions[:, :2]) < 0.17).all(axis=1)
        # Below the cloth there is no room: it lies RADIUS above the floor.
        assert scene.positions[inside, 2].min() > RADIUS + CONTACT


def test_a_jet_does_not_get_through_a_cloth_that_hangs_by_its_corners():
    scene = FlexScene(cloth(10, 0.05, corners(10), pos="0 0 0.4", mover="plugin"), (5, 5), 12, 0.43)
    scene.velocities[:, 2] = -3.0
    for _ in range(12):
        scene.step(4)
        near = np.abs(scene.positions[:, :2]).max(axis=1) < 0.15
        distance, side = scene.nearest(scene.positions)
        # A change of side is a way around the rim, 7 cm away.
        assert not (near & (side < 0) & (distance < 0.1)).any()
        assert distance.min() > RADIUS + CONTACT - 1e-3
    assert (near & (side > 0)).sum() > 50


@pytest.mark.parametrize(("radius", "young", "mass"), [(0.005, 2e5, 0.05), (0.001, 1e3, 0.02)])
def test_nothing_gets_through_a_cloth_shaken_at_2_m_s(radius, young, mass):
    """It is the floor of a tall box; taut, and so soft that it flutters."""
    count, half = 9, 0.05
    drum = cloth(count, 0.13 / (count - 1), rim(count), radius=radius, young=young, mass=mass)
    walls = cup_geoms(2 * half, 2 * half, 0.005, 2.0, -0.5)
    inside = f'{SLIDES}{drum}{walls}<plugin instance="water"/>'
    frame = f'<body name="frame" pos="0 0 1" gravcomp="1">{inside}</body>'
    scene = FlexScene(frame, (5, 5), 10, 1.03)
    random = np.random.default_rng(0)
    for step in range(200):
        if step % 12 == 0:
            velocity = 2 * random.permutation([random.choice([-1, 1]), 0, 0])
        scene.data.qvel[:3] = velocity
        scene.step()
        x = scene.positions - scene.data.qpos[:3] - [0, 0, 1]
        assert (np.abs(x[:, :2]) < half).all()
        if step % 10 == 0:
            _, side = scene.nearest(scene.positions)
            assert (side > 0).all()
    assert np.isfinite(scene.data.plugin_state).all()


def test_triangles_may_be_far_larger_than_the_water_is_apart():
    scene = FlexScene(cloth(2, 3.0, range(4), pos="0 0 -0.4"), (20, 20), 1, 0, max_speed=5)
    scene.positions[:, :2] *= 8  # Drops, some spacings apart on 2.7 m.
    scene.step(60)
    np.testing.assert_allclose(scene.positions[:, 2], -0.4 + RADIUS + CONTACT, atol=1e-3)


def test_water_caught_under_a_falling_cloth_stays_below_it():
    """It does not come through, and nothing explodes where there is no room."""
    world = '<geom type="plane" size="1 1 1"/>' + cloth(8, 0.04, pos="0 0 0.12", mover="plugin")
    scene = FlexScene(world, (5, 5), 2, 0.02)
    for step in range(80):
        scene.step()
        if step % 4:
            continue
        near = np.abs(scene.positions[:, :2]).max(axis=1) < 0.1
        distance, side = scene.nearest(scene.positions)
        assert not (near & (side > 0) & (distance < 0.03)).any()
    assert np.linalg.norm(scene.velocities, axis=1).max() < 3
    assert scene.points()[:, 2].max() < 0.03


@pytest.mark.parametrize("cloth_first", [False, True])
def test_water_sees_cloth_where_a_step_ends(cloth_first):
    """Whichever of the two plugins comes first in the model."""
    sheet = cloth(10, 0.05, corners(10), pos="0 0 0.4", mover="plugin")
    scene = FlexScene(sheet, (5, 5), 12, 0.43, cloth_first=cloth_first)
    water, size = scene.instance, 3 * scene.model.nflexvert
    assert water == int(cloth_first)
    end = scene.model.plugin_stateadr[water] + scene.model.plugin_statenum[water]
    for _ in range(20):
        scene.step()
        seen = scene.data.plugin_state[end - size : end].reshape(-1, 3)
        np.testing.assert_allclose(seen, scene.points(), atol=1e-12)


# ---------------------------------------------------------------------- physics


def test_water_stands_on_a_cloth_as_on_a_floor():
    """In a box whose bottom is a pinned cloth, or a board with the same surface."""
    columns, layers = (8, 8), 14
    half = columns[0] * SPACING / 2
    walls = cup_geoms(2 * half, 2 * half, 0.005, 0.6, -0.3)
    board = '<geom type="box" size="0.1 0.1 0.005" pos="0 0 -0.005"/>'
    sheet = cloth(7, 0.03, range(49), pos=f"0 0 {-RADIUS}")
    heights, deviations = [], []
    for world in (board, sheet):
        body = f'<body name="cup">{walls}<plugin instance="water"/></body>'
        scene = FlexScene(world + body, columns, layers, SPACING / 2)
        scene.step(300)
        z = scene.positions[:, 2]
        assert z.min() > CONTACT - NEAR
        assert np.sqrt((scene.velocities**2).sum(axis=1).mean()) < 0.005
        heights.append(2 * z.mean())
        deviations.append(z.max())
    assert heights[1] == pytest.approx(layers * SPACING, rel=0.03)
    assert heights[1] == pytest.approx(heights[0], rel=0.005)
    assert deviations[1] == pytest.approx(deviations[0], abs=0.3 * SPACING)


def test_a_cloth_that_hangs_by_its_corners_is_a_bag():
    """It holds water for seconds, which comes to rest in it."""
    scene = FlexScene(cloth(12, 0.04, corners(12), pos="0 0 0.5", mover="plugin"), (5, 5), 6, 0.5)
    scene.step(150)
    held = scene.positions[:, 2] > 0.2
    assert held.sum() > 60
    scene.step(150)
    assert (scene.positions[held, 2] > 0.2).mean() > 0.97
    held = scene.positions[:, 2] > 0.2
    assert np.sqrt((scene.velocities[held] ** 2).sum(axis=1).mean()) < 0.02


def test_a_stream_parts_at_a_cord():
    scene = FlexScene(rope(9, 0.03, [0, 8], pos="0 0 0.4"), (3, 3), 20, 0.43)
    scene.velocities[:, 2] = -3.0
    hold = scene.model.flex_radius[0] + CONTACT
    touching = 0
    for _ in range(30):
        scene.step()
        distance, _ = scene.nearest(scene.positions)
        assert distance.min() > hold - NEAR
        touching += (distance < hold + 0.001).sum()
    assert touching > 50
    assert (scene.positions[:, 2] < 0.3).mean() > 0.95  # It has passed.
    assert np.ptp(scene.positions[:, 1]) > 0.2


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_friction_on_a_slope_is_coulombs(friction):
    angle = np.deg2rad(30)
    board = cloth(2, 1.0, range(4), euler="0 30 0")
    scene = FlexScene(board, (1, 1), 1, 0, friction=friction, viscosity=0)
    normal = np.array([np.sin(angle), 0, np.cos(angle)])
    down = np.array([np.cos(angle), 0, -np.sin(angle)])
    scene.positions[0] = (RADIUS + CONTACT) * normal
    scene.step(20)
    expected = 9.81 * (np.sin(angle) - friction * np.cos(angle)) * 0.2
    assert scene.velocities[0] @ down == pytest.approx(expected, rel=0.01)
    assert scene.velocities[0] @ normal == pytest.approx(0, abs=0.001)


# ---------------------------------------------------------------------- part of MuJoCo


@pytest.mark.parametrize("pos", ["0 0 0.3", "0 0 50"])
def test_flexes_that_are_off_or_far_change_no_bit(pos):
    """By default water falls through; with a cloth 50 m above it is all the same."""
    states = []
    for flexes in ("false", "true"):
        scene = FlexScene(cloth(5, 0.05, range(25), pos=pos), (4, 4), 4, 0.33, flexes=flexes)
        scene.step(30)
        states.append(scene.data.plugin_state.copy())
    off, on = states
    assert len(on) == len(off) + 3 * 25
    assert np.array_equal(on[: len(off)], off) == (pos == "0 0 50")
    assert (off[1 : 1 + 3 * 64].reshape(-1, 3)[:, 2] < 0.3).all()


def test_a_cloth_that_jumps_is_not_swept():
    """A fast flex counts as teleported; with the first state entry cleared any motion does."""
    for jump, known, taken in ((1.0, 1, False), (0.05, 1, True), (0.05, 0, False)):
        sheet = cloth(4, 0.06, range(16))
        body = f'<body name="board" mocap="true" pos="0 0 0.3">{sheet}</body>'
        scene = FlexScene(body, (3, 3), 1, 0.33)
        scene.step(10)
        x = scene.positions[:, 2].copy()
        scene.data.plugin_state[0] = known
        scene.data.mocap_pos[0, 2] += jump
        scene.step()
        assert ((scene.positions[:, 2] - x).mean() > 0.02) == taken
        assert np.abs(scene.velocities).max() < 10


UNFIT = """<flexcomp name="{}" type="grid" dim="3" count="3 3 3" spacing=".1 .1 .1" mass="1" {}>
  <contact selfcollide="none"/><elasticity young="1e4" poisson="0.2"/></flexcomp>"""


def test_what_cannot_be_handled_is_a_compile_error():
    solid, lattice = UNFIT.format("jelly", ""), UNFIT.format("jelly", 'dof="trilinear"')
    for world in (solid, lattice):
        with pytest.raises(ValueError, match=r'"water".*flex "jelly" cannot hold the fluid back'):
            FlexScene(world, (2, 2), 2, 1)
        FlexScene(world, (2, 2), 2, 1, flexes="false")
    with pytest.raises(ValueError, match=re.escape('flexes="maybe" is not valid')):
        FlexScene("", (2, 2), 2, 1, flexes="maybe")


@pytest.mark.parametrize("flexes", [False, True])
def test_the_entity_passes_it_on(flexes):
    water = Water(Liquid(2e-4), Resolution(27, SPACING, (3, 3)), flexes=flexes)
    config = water.mjcf_model.extension.plugin[0].instance[0].config
    assert [c.value for c in config if c.key == "flexes"] == [str(flexes).lower()]
