"""Cloth that touches itself behaves like cloth: no crossings, friction, momentum, energy, rest.

Oracles: geometry, Coulomb, conservation laws, MuJoCo's self-collision and a cloth without any.
"""

import mujoco
import numpy as np
import pytest

import softgym_mj
from softgym_mj.baselines.manipulation_scene import ManipulationScene, fold
from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cloth import RADIUS, Cloth
from softgym_mj.native.library import CLOTH_CONTACT, load_plugin
from softgym_mj.robots.base import SIM_STEP

SMALL, LARGE = (60, 60), (92, 92)  # 13 x 13 and 20 x 20 vertices.
FULL_SPEED = 3**0.5  # [m/s] of a picker at full speed along three axes.
SKY = np.array([0.0, 0.0, 5.0])  # Nothing up here reaches the floor.
GRAVITY = 9.8
MOTION = pytest.mark.parametrize("motion", ["noise", "implosion", "spin"])
FRICTION = pytest.mark.parametrize("friction", [0.1, 0.4, 0.8])
# [m] by which the mesh of one sheet is shifted to the other's: vertices on vertices, or beside.
SHIFT = pytest.mark.parametrize("shift", [0.0, 0.01])
SHEET = """
<flexcomp name="{name}" type="grid" dim="2" count="{n} {n} 1" spacing=".03 .03 .03"
          pos="{shift} {shift} {z}" radius=".005" mass="{mass}">
  <contact selfcollide="none" contype="1" conaffinity="0" condim="3" friction="0"/>
  <elasticity young="2e5" poisson=".2" thickness="5e-4" damping=".01" elastic2d="both"/>
  <edge equality="false"/>{pin}<plugin plugin="softgym_mj.cloth_contact" instance="contact"/>
</flexcomp>"""


class Sheet:
    """A cloth alone on the floor; `crossings` is the most intersections, every 5th step."""

    def __init__(
        self, dims=SMALL, vertices=None, velocities=0.0, box=False, friction=None, **settings
    ):
        self.cloth = Cloth(dims=dims, **settings)
        if friction is not None:
            values = {parameter.name: parameter.nominal for parameter in self.cloth.parameters}
            self.cloth.adjust({**values, "friction": friction, "layer_friction": friction})
        arena = Arena(camera="cloth")
        arena.attach(self.cloth)
        if box:  # 12 x 12 x 6 cm, 0.1 kg, 2 cm above the floor.
            body = arena.mjcf_model.worldbody.add("body", name="box", pos=[0.14, 0.0, 0.052])
            body.add("freejoint")
            body.add("geom", type="box", size=[0.06, 0.06, 0.03], mass=0.1)
        self.physics = arena.compile(self.cloth.timestep, self.cloth)
        self.model, self.data = self.physics.model.ptr, self.physics.data.ptr
        self.cloth.set_vertices(self.cloth.flat() if vertices is None else vertices, velocities)
        first = self.model.body("cloth/flex_0").dofadr[0]
        self.mass = self.model.dof_M0[first : first + 3 * self.cloth.num_vertices : 3, None].copy()
        self.crossings, self._count = 0, 0

    def step(self, count=1):
        for _ in range(count):
            mujoco.mj_step(self.model, self.data)
            self._count += 1
            if self._count % 5 == 0:
                self.crossings = max(self.crossings, self.cloth.intersections())

    def drive(self, vertices, displacement, duration):
        """Carries vertices along a displacement (3,) [m] for a time [s]."""
        steps = round(duration / SIM_STEP)
        starts = [self.cloth.vertex(v) for v in vertices]
        for k in range(steps):
            for vertex, start in zip(vertices, starts, strict=True):
                self.cloth.hold(vertex)
                goal = start + (k + 1) / steps * np.asarray(displacement, float)
                self.cloth.drive(vertex, goal, SIM_STEP)
            self.step()

    def crumple(self, vertex, rest=2.0):
        """Lifts a vertex by 0.6 m at 1 m/s, holds it for a second, drops it and rests [s]."""
        self.drive([vertex], [0.0, 0.0, 0.6], 0.6)
        self.drive([vertex], [0.0, 0.0, 0.0], 1.0)
        self.cloth.release_all()
        self.step(round(rest / SIM_STEP))

    def stretching_energy(self):
        """Energy [J] of MuJoCo's membrane elasticity, which `mjData.energy` leaves out."""
        model, x = self.model, self.cloth.vertices()
        square = ((x[self.cloth.edges[:, 0]] - x[self.cloth.edges[:, 1]]) ** 2).sum(axis=1)
        change = (square - model.flexedge_length0**2)[model.flex_elemedge.reshape(-1, 3)]
        rows, columns = np.triu_indices(3)
        twice = np.where(rows == columns, 1.0, 2.0)
        stiffness = model.flex_stiffness.reshape(-1, 21)[:, :6]
        return 0.25 * (twice * stiffness * change[:, rows] * change[:, columns]).sum()

    def energies(self, steps):
        """Kinetic + stretching + gravitational energy [J] now and after each step, not bending."""
        self.model.flex_bending[:] = 0.0
        energies = []
        for _ in range(steps + 1):
            kinetic = 0.5 * (self.mass * self.cloth.velocities() ** 2).sum()
            height = self.cloth.vertices() @ -self.model.opt.gravity
            energies.append(kinetic + self.stretching_energy() + self.mass[:, 0] @ height)
            self.step()
        return np.array(energies)


def folded(dims, **settings):
    """Vertices of a cloth folded in half; the lower layer's free edge is the last column."""
    scene = ManipulationScene(Cloth(dims=dims, **settings))
    fold(scene, speed=0.6, rest=0.5)
    assert scene.record.end_intersections == 0
    return scene.cloth.vertices()


@pytest.fixture(scope="module")
def small_fold():
    return folded(SMALL)


@pytest.fixture(scope="module")
def heap():
    """Vertices of a crumpled small cloth."""
    sheet = Sheet()
    sheet.crumple(41, rest=1.0)
    return sheet.cloth.vertices()


@pytest.mark.parametrize("speed", [0.6, 1.0, FULL_SPEED])
@pytest.mark.parametrize("dims", [SMALL, pytest.param((90, 90), marks=pytest.mark.slow)])
def test_no_layer_passes_another_in_a_fold(speed, dims):
    scene = ManipulationScene(Cloth(dims=dims))
    fold(scene, speed)
    assert scene.record.most_intersections == scene.record.end_intersections == 0


def test_mujocos_self_collision_lets_layers_pass_in_a_fast_fold():
    """What these tests would see if contact failed."""
    scene = ManipulationScene(Cloth(dims=(90, 90), self_contact="mujoco"))
    fold(scene, FULL_SPEED, rest=0.1)
    assert scene.record.most_intersections > 20


@pytest.mark.parametrize(
    ("dims", "fidelity", "seed"),
    [
        pytest.param(dims, fidelity, seed, marks=[pytest.mark.slow] * (dims != SMALL or seed > 1))
        for dims, fidelity in ((SMALL, "default"), ((110, 90), "fast"))
        for seed in range(12)
    ],
)
def test_a_crumpled_cloth_is_neither_knotted_nor_squeezed(dims, fidelity, seed):
    sheet = Sheet(dims, fidelity=fidelity)
    sheet.crumple(int(np.random.default_rng(seed).integers(sheet.cloth.num_vertices)))
    assert sheet.crossings == sheet.cloth.intersections() == 0
    strain = sheet.cloth.edge_strain()
    # Most stay below 10 %, two of twelve get to 12 %; with MuJoCo's self-collision to 11 %.
    assert np.percentile(np.abs(strain), 99) <= 0.13
    assert strain.min() > -0.5


@pytest.mark.parametrize("direction", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)])
def test_a_buried_vertex_is_pulled_out_of_a_heap(heap, direction):
    sheet = Sheet(vertices=heap)
    above = heap[None, :, 2] > heap[:, None, 2] + RADIUS
    above &= np.linalg.norm(heap[None, :, :2] - heap[:, None, :2], axis=2) < 0.03
    buried = int(above.sum(axis=1).argmax())
    assert above[buried].sum() >= 8
    sheet.drive([buried], 0.4 * np.array(direction), 0.4)
    assert sheet.crossings == sheet.cloth.intersections() == 0
    assert np.linalg.norm(sheet.cloth.vertex(buried) - heap[buried]) == pytest.approx(0.4, abs=1e-3)


@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_a_folded_cloth_is_dragged_by_a_corner_of_its_lower_layer(small_fold, speed):
    sheet = Sheet(vertices=small_fold)
    sheet.drive([sheet.cloth.index(0, -1)], [0.3, 0.0, 0.0], 0.3 / speed)
    assert sheet.crossings == sheet.cloth.intersections() == 0


@pytest.mark.parametrize(
    ("fidelity", "episodes", "steps"),
    [("fast", 1, 15), pytest.param("default", 50, 100, marks=pytest.mark.slow)],
)
def test_random_pickers_do_not_tangle_a_cloth(fidelity, episodes, steps):
    env = softgym_mj.load("spread_cloth", split="all", fidelity=fidelity, count_intersections=True)
    random = np.random.default_rng(11)
    farthest = 0.0
    for episode in range(episodes):
        env.reset(735 + episode)  # 735 is the smallest cloth of all.
        start = env.task.points()
        for _ in range(steps):
            env.step(random.uniform(-1, 1, env.task.actor.action_size))
            assert env.info()["intersections"] == 0
        farthest = max(farthest, np.abs(env.task.points() - start).max())
    assert farthest > 0.1


@pytest.mark.parametrize("dims", [LARGE, (96, 58), SMALL])
def test_a_fold_comes_to_rest(dims):
    scene = ManipulationScene(Cloth(dims=dims))
    fold(scene, speed=0.6, rest=1.0)
    speeds = []
    for _ in range(100):
        scene.step(np.zeros((2, 3)), grip=False)
        speeds.append(np.linalg.norm(scene.cloth.velocities(), axis=1))
    assert np.sqrt(np.mean(np.square(speeds))) <= 1e-3
    assert np.max(speeds) <= 0.02


def test_a_box_rests_on_two_layers_as_on_mujocos():
    bottom, apart = {}, {}
    for self_contact in ("plugin", "mujoco"):
        start = folded(LARGE, self_contact=self_contact)
        sheet = Sheet(LARGE, start, box=True, self_contact=self_contact)
        sheet.step(100)
        address = sheet.model.jnt_qposadr[sheet.model.body("box").jntadr[0]]
        box, grid = sheet.data.qpos[address : address + 3], sheet.cloth.grid()
        bottom[self_contact] = box[2] - 0.03
        under = (np.abs(grid[..., :2] - box[:2]) < 0.05).all(axis=2)
        half = grid.shape[1] // 2
        upper, lower = (np.s_[:, :half], np.s_[:, half:])
        apart[self_contact] = grid[upper][under[upper], 2].mean()
        apart[self_contact] -= grid[lower][under[lower], 2].mean()
    assert bottom["plugin"] == pytest.approx(bottom["mujoco"], abs=1e-3)
    assert 0.008 < apart["plugin"] < 0.011


def slide(friction, shift, pull=0.0, speed=0.0, steps=20):
    """How far [m] a sheet slides on a larger, fixed one; `pull` [m/s^2] and `speed` along X."""
    load_plugin()
    # A sheet that is all fixed is no flex to MuJoCo: one column stays free.
    pin = '<pin gridrange="0 0 7 8"/>'
    low = SHEET.format(name="low", n=9, shift=0, z=0, mass=0.01, pin=pin)
    top = SHEET.format(name="top", n=6, shift=shift, z=0.01, mass=0.005, pin="")
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep=".01" integrator="discrete" solver="CG" tolerance="1e-6"/>
        <extension><plugin plugin="{CLOTH_CONTACT}"><instance name="contact"/></plugin></extension>
        <worldbody>{low}{top}</worldbody></mujoco>"""
    )
    model.flex_friction[:, 0] = friction  # Live: the model was compiled without.
    model.opt.gravity[:] = [pull, 0.0, -GRAVITY]
    data = mujoco.MjData(model)
    data.qvel.reshape(-1, 3)[-36:, 0] = speed
    mujoco.mj_step(model, data, steps)
    return data.qpos.reshape(-1, 3)[-36:, 0].mean()


@FRICTION
@SHIFT
def test_a_layer_slips_where_coulomb_says(friction, shift):
    """At 0.9 of the friction limit it sticks, at 1.5 it runs off with what is above the limit."""
    limit = friction * GRAVITY
    assert abs(slide(friction, shift, pull=0.9 * limit)) < 5e-5
    free = 0.5 * (0.5 * limit) * SIM_STEP**2 * 20 * 21
    assert 0.5 * free < slide(friction, shift, pull=1.5 * limit) < 1.3 * free


@SHIFT
def test_a_sliding_layer_stops_the_sooner_the_rougher(shift):
    """Coulomb: after v^2 / 2 mu g. Meshes hook into each other a little, so it may be less."""
    frictions = np.array([0.1, 0.4, 0.8])
    distances = np.array([slide(mu, shift, speed=0.3, steps=60) for mu in frictions])
    coulomb = 0.3**2 / (2 * frictions * GRAVITY)
    assert (np.diff(distances) < 0).all()
    assert (0.25 * coulomb < distances).all() and (distances < 1.05 * coulomb).all()


@FRICTION
def test_layers_stay_together_when_the_lower_one_is_dragged(small_fold, friction):
    sheet = Sheet(vertices=small_fold, friction=friction)
    rows, columns = sheet.cloth.shape
    start = sheet.cloth.grid()
    sheet.drive([sheet.cloth.index(r, columns - 1) for r in range(rows)], [0.3, 0, 0], 1.0)
    moved = (sheet.cloth.grid() - start)[..., :2]
    half = columns // 2
    shear = np.linalg.norm((moved - moved[:, ::-1])[:, :half], axis=-1)
    assert shear.mean() < 0.005  # Of 0.3 m.
    assert moved[:, :half, 0].mean() > 0.29


def floating(heap, motion, **settings):
    """A heap driven into itself, without gravity, far from the floor; steps are solved exactly."""
    centred = heap - heap.mean(axis=0)
    velocities = {
        "noise": np.random.default_rng(0).normal(0, 0.3, heap.shape),
        "implosion": -8.0 * centred,
        "spin": np.cross([0.0, 0.0, 8.0], centred) - 6.0 * centred,
    }
    sheet = Sheet(vertices=heap + SKY, velocities=velocities[motion], **settings)
    sheet.model.opt.gravity[:] = 0.0
    sheet.model.opt.tolerance = 1e-8
    return sheet


def test_the_energy_of_these_tests_is_mujocos(heap):
    """Its slope along a random direction is the force, without bending."""
    sheet = Sheet(vertices=heap + SKY)
    sheet.model.flex_bending[:] = 0.0
    mujoco.mj_forward(sheet.model, sheet.data)
    direction = np.random.default_rng(0).normal(0, 1e-6, heap.shape)
    energies = []
    for sign in (1, -1):
        sheet.cloth.set_vertices(heap + SKY + sign * direction)
        energies.append(sheet.stretching_energy())
    work = sheet.data.qfrc_spring @ direction.ravel()
    assert energies[1] - energies[0] == pytest.approx(2 * work, rel=1e-5)


@MOTION
def test_a_floating_heap_never_gains_energy(heap, motion):
    sheet = floating(heap, motion)
    energies = sheet.energies(100)
    assert np.diff(energies).max() < 1e-6 * energies[0]
    assert sheet.crossings == 0


def test_a_collapsing_zigzag_only_loses_energy():
    """Four flaps of three cells, steep as a roof, on the floor."""
    sheet, slope = Sheet(), np.deg2rad(60.0)
    grid, side = sheet.cloth.grid(), sheet.cloth.size[0] / 12
    up = np.where(np.arange(12) // 3 % 2 == 0, 1.0, -1.0)
    grid[..., 0] = side * np.cos(slope) * (np.arange(13) - 6)
    grid[..., 2] = RADIUS + np.concatenate([[0.0], np.cumsum(up * side * np.sin(slope))])
    sheet.cloth.set_vertices(grid)
    energies = sheet.energies(150)
    # The floor gives back a little where vertices sink in: 3.4 % with MuJoCo's self-collision.
    assert (energies - np.minimum.accumulate(energies)).max() < 0.015 * energies[0]
    assert energies[-1] < 0.6 * energies[0]  # With either self-collision 0.54.


@MOTION
def test_self_contact_keeps_the_momentum(heap, motion):
    sheets = [floating(heap, motion, self_contact=mode) for mode in ("plugin", "none")]
    mass, start = sheets[0].mass, sheets[0].cloth.velocities()
    for _ in range(50):
        for sheet in sheets:
            sheet.step()
        change = (mass * (sheets[0].cloth.velocities() - start)).sum(axis=0)
        assert np.linalg.norm(change) < 1e-6 * np.linalg.norm(mass * start, axis=1).sum()
    assert np.abs(sheets[0].cloth.velocities() - sheets[1].cloth.velocities()).max() > 0.05
    assert sheets[0].crossings == 0 and sheets[1].crossings > 10


@MOTION
def test_contact_impulses_have_no_torque(heap, motion):
    """In one step, as the engine's own loses angular momentum; friction acts on a lever of 1 cm."""
    after = []
    for mode in ("plugin", "none"):
        sheet = floating(heap, motion, self_contact=mode, friction=0.0)
        sheet.step()
        after.append(sheet.cloth.velocities())
    assert np.abs(after[0] - after[1]).max() > 0.1
    torques = np.cross(heap - heap.mean(axis=0), sheet.mass * (after[0] - after[1]))
    assert np.linalg.norm(torques.sum(axis=0)) < 1e-5 * np.linalg.norm(torques, axis=1).sum()


def test_a_cloth_that_touches_nothing_moves_as_without():
    """To the bit, with the same tolerance."""
    states = []
    for mode in ("plugin", "none"):
        sheet = Sheet(self_contact=mode)
        sheet.model.opt.tolerance = 1e-5
        noise = np.random.default_rng(1).normal(0, 0.05, (sheet.cloth.num_vertices, 3))
        sheet.cloth.set_vertices(sheet.cloth.flat() + SKY, noise)
        sheet.step(50)
        states.append((sheet.cloth.vertices(), sheet.cloth.velocities()))
    np.testing.assert_array_equal(states[0], states[1])


def test_a_flat_cloth_rests_as_without():
    """On the way the plugin stops vertices at the floor that MuJoCo lets sink in by 1 mm."""
    states = []
    for mode in ("plugin", "none"):
        sheet = Sheet(self_contact=mode)
        sheet.model.opt.tolerance = 1e-8
        sheet.step(100)
        states.append(sheet.cloth.vertices())
    np.testing.assert_allclose(states[0], states[1], rtol=0, atol=1e-6)
