"""Cloth and rope against meshes and heightfields.

Oracles are shapes of MuJoCo, Coulomb's law, MuJoCo's rays and exact distances to triangles.
"""

import mujoco
import numpy as np
import pytest
import trimesh

from softgym_mj.cloth import solver
from tests.cloth.flex_scene import (
    GRAVITY,
    RADIUS,
    TIMESTEP,
    WOVEN,
    Flex,
    FlexScene,
    grid,
    material_of,
    model_xml,
    rope,
    sheet,
    straight,
)
from tests.oracles.mesh_distance import mesh_distance
from tests.scenes import solid_meshes
from tests.scenes.solid_meshes import heights_asset, mesh_asset

MESH = '<geom name="solid" type="mesh" mesh="solid" friction=".01" {}/>'
HEIGHTS = '<geom name="solid" type="hfield" hfield="solid" friction=".01" {}/>'


def scene(*flexes, scenery: str, **settings) -> FlexScene:
    return FlexScene(*flexes, scenery=scenery, floor=False, hit_interval=10**9, **settings)


def points_of(scene: FlexScene, pieces: int = 4) -> np.ndarray:
    """Points (n, 3) [m] spread over all triangles, or over all edges of a rope."""
    corners = scene.triangles if len(scene.triangles) else scene.edges
    weights = np.stack(np.meshgrid(*[np.arange(pieces + 1)] * corners.shape[1]), axis=-1)
    weights = weights.reshape(-1, corners.shape[1])
    weights = weights[weights.sum(axis=1) == pieces] / pieces
    return np.einsum("sk,tkd->tsd", weights, scene.positions()[corners]).reshape(-1, 3)


def overlap(scene: FlexScene, vertices: np.ndarray, faces: np.ndarray) -> float:
    """Largest depth [m] of a flex of its radius in a mesh."""
    points = points_of(scene)
    low, high = vertices.min(axis=0) - 0.01, vertices.max(axis=0) + 0.01
    near = points[((points > low) & (points < high)).all(axis=1)]
    if not len(near):
        return -np.inf
    return scene.model.flex_radius[0] - mesh_distance(near, vertices, faces).min()


# ------------------------------------------------------------------ the same as other shapes


def test_a_mesh_of_a_sphere_touches_as_a_sphere():
    """Contacts lie at the radius around it, push along it, and carry the weight."""
    radius, cloth = 0.1, sheet(12, 12, center=(0.0, 0.0, 0.11), fabric=WOVEN)
    rest = scene(
        cloth, scenery=MESH.format('pos="0 0 0"'), extra=mesh_asset(*solid_meshes.sphere(radius))
    )
    rest.step(150)
    contacts = solver.contacts(rest.model, rest.data)
    assert len(contacts) > 20
    where = (contacts["weight"][..., None] * rest.positions()[contacts["vertex"]]).sum(axis=1)
    distance = np.linalg.norm(where, axis=1)
    # A triangle's middle is 0.1 mm inside the sphere; a contact yields by 1 mm per 2 N.
    np.testing.assert_allclose(distance - radius, RADIUS, atol=5e-4)
    cosine = (contacts["normal"] * where).sum(axis=1) / distance
    assert cosine.min() > np.cos(np.radians(2.0))
    force = contacts["force"].sum(axis=0)
    np.testing.assert_allclose(force, [0.0, 0.0, cloth.mass * GRAVITY], atol=0.03 * force[2])


@pytest.mark.parametrize("thing", ["cloth", "rope"])
@pytest.mark.parametrize("excess", [0.95, 1.3])
@pytest.mark.parametrize("ground", ["mesh", "heightfield"])
def test_things_hold_on_a_slope_or_slide_as_coulomb_says(ground, excess, thing):
    """`excess` times as steep as the angle of friction."""
    friction = 0.5
    tangent = excess * friction
    turn = solid_meshes.turn(tangent)
    if thing == "rope":
        flex = rope(straight(11, 0.0125, (-0.35, 0.0, 0.00625)))
    else:
        flex = sheet(6, 6, center=(-0.35, 0.0, RADIUS), fabric=WOVEN)
    flex.points, flex.friction = flex.points @ turn.T, friction
    if ground == "mesh":
        solid, asset = MESH.format(""), mesh_asset(*solid_meshes.slope(tangent))
    else:
        heights = np.tile(np.linspace(1.0, 0.0, 31), (31, 1))
        solid = HEIGHTS.format(f'pos="0 0 {-0.6 * tangent}"')
        asset = heights_asset(heights, 0.6, 1.2 * tangent)
    slides = scene(flex, scenery=solid, extra=asset)
    slides.step(10)
    ways = []
    for _ in range(3):
        ways.append((slides.positions() @ turn[:, 0]).mean())
        slides.step(20)
    found = (ways[2] - 2 * ways[1] + ways[0]) / (20 * TIMESTEP) ** 2
    angle = np.arctan(tangent)
    expected = max(0.0, GRAVITY * (np.sin(angle) - friction * np.cos(angle)))
    assert found == pytest.approx(expected, rel=0.01, abs=2e-3)


@pytest.mark.parametrize("inward", [False, True])
def test_a_bowl_is_not_filled(inward):
    """A cloth falls into a mesh, not onto its convex hull; all faces may be turned inward."""
    vertices, faces = solid_meshes.bowl(0.15)
    falls = scene(
        sheet(5, 5, center=(0.0, 0.0, 0.02)),
        scenery=MESH.format(""),
        extra=mesh_asset(vertices, faces[:, ::-1] if inward else faces),
    )
    falls.step(60)
    assert -0.15 < falls.positions()[:, 2].min() < -0.13


# ------------------------------------------------------------------ depths


def test_a_cloth_lies_on_a_bunny():
    rest = scene(
        sheet(20, 20, center=(0.0, 0.0, 0.27), fabric=WOVEN),
        scenery=MESH.format("").replace(".01", "1"),
        extra=mesh_asset(*solid_meshes.bunny()),
    )
    mujoco.mj_forward(rest.model, rest.data)
    mesh = solid_meshes.mesh_in_world(rest.model, rest.data, "solid")
    for _ in range(8):
        rest.step(10)
        assert overlap(rest, *mesh) < 2e-3
    rest.step(100)
    assert 0.0 < overlap(rest, *mesh) < 1e-3
    assert rest.positions()[:, 2].max() > 0.15 and len(solver.contacts(rest.model, rest.data)) > 10


@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_a_forearm_pushes_a_hanging_cloth(speed):
    """A mesh on an actuated joint does not sink in."""
    cloth = sheet(14, 14, center=(0.0, 0.0, 0.0), fabric=WOVEN)
    cloth.points = cloth.points[:, [2, 0, 1]]
    limb = MESH.format('mass="2" euler="80 0 0"')
    link = f"""<body pos="-.12 0 -.05" gravcomp="1">{limb}
        <joint name="slide" type="slide" axis="1 0 0"/></body>"""
    motor = '<actuator><position joint="slide" kp="4000" kv="200"/></actuator>'
    pushed = scene(cloth, scenery=link, extra=mesh_asset(*solid_meshes.forearm()) + motor)
    pushed.hold(*np.flatnonzero(cloth.points[:, 2] == cloth.points[:, 2].max()))
    deepest = 0.0
    for k in range(round(0.25 / speed / TIMESTEP)):
        pushed.data.ctrl[0] = speed * TIMESTEP * (k + 1)
        pushed.step()
        if k % 5 == 0 and len(solver.contacts(pushed.model, pushed.data)):
            mujoco.mj_kinematics(pushed.model, pushed.data)
            mesh = solid_meshes.mesh_in_world(pushed.model, pushed.data, "solid")
            deepest = max(deepest, overlap(pushed, *mesh))
    assert 0.0 < deepest < 1e-3
    assert pushed.positions()[:, 0].max() > 0.1


def sleeve(around: int, along: int, spacing: float) -> Flex:
    """A tube of cloth along X."""
    angle = 2 * np.pi / around * np.arange(around)
    ring = (
        spacing / (2 * np.sin(np.pi / around)) * np.array([0 * angle, np.cos(angle), np.sin(angle)])
    )
    x = spacing * (np.arange(along) - (along - 1) / 2)
    points = (ring.T + x[:, None, None] * np.array([1.0, 0.0, 0.0])).reshape(-1, 3)
    # The last column of a grid is the first one.
    row, column = np.divmod(grid(along, around + 1), around + 1)
    mass = WOVEN.density * spacing**2 * around * (along - 1)
    return Flex(points, row * around + column % around, mass, material_of(WOVEN), friction=0.5)


def test_a_forearm_swings_in_its_sleeve():
    link = f"""<body gravcomp="1">{MESH.format('mass="2" euler="0 90 0"')}
        <joint name="slide" type="slide" axis="0 1 0"/><joint name="swing" axis="0 1 0"/></body>"""
    motors = """<actuator><position joint="slide" kp="4000" kv="200"/>
        <position joint="swing" kp="200" kv="10"/></actuator>"""
    swings = scene(
        sleeve(16, 8, 0.022),
        scenery=link,
        extra=mesh_asset(*solid_meshes.forearm()) + motors,
        option='integrator="implicitfast"',
    )
    deepest = 0.0
    for k in range(150):
        time = TIMESTEP * k
        swings.data.ctrl[:] = 0.1 * np.sin(5 * time), 0.3 * np.sin(4 * time)
        swings.step()
        if k % 10 == 0:
            mujoco.mj_kinematics(swings.model, swings.data)
            mesh = solid_meshes.mesh_in_world(swings.model, swings.data, "solid")
            deepest = max(deepest, overlap(swings, *mesh))
    assert 0.0 < deepest < 5e-4
    assert np.linalg.norm(swings.positions().mean(axis=0) - swings.data.geom("solid").xpos) < 0.03


def test_a_rope_stays_on_a_thin_mesh():
    """A rod of 4 mm radius, onto which it falls from 15 cm."""
    rod = trimesh.creation.cylinder(0.004, segment=[(0.0, -0.3, 0.0), (0.0, 0.3, 0.0)])
    falls = scene(
        rope(straight(41, 0.0125, (-0.25, 0.0, 0.16))),
        scenery=MESH.format("").replace(".01", "1"),
        extra=mesh_asset(rod.vertices, rod.faces),
    )
    falls.step(60)
    assert falls.positions()[:, 2].max() > 0.007


@pytest.mark.parametrize("thing", ["rope", "cloth"])
def test_things_lie_on_a_heightfield(thing):
    """Cells of 4 cm with random heights of up to 5 cm."""
    flex = rope(straight(41, 0.0125, (-0.25, 0.03, 0.1)))
    if thing == "cloth":
        flex = sheet(12, 12, center=(0.0, 0.0, 0.1), fabric=WOVEN)
    heights = np.random.default_rng(0).random((21, 21))
    rest = scene(flex, scenery=HEIGHTS.format(""), extra=heights_asset(heights, 0.4, 0.05))
    for _ in range(4):
        rest.step(25)
        points = points_of(rest)
        surface = solid_meshes.surface_of_heights(rest.model)
        distance = mesh_distance(points, *surface, is_closed=False)
        assert distance.min() > flex.radius - 2e-3
    assert distance.min() < flex.radius
    mujoco.mj_forward(rest.model, rest.data)
    down = np.array([0.0, 0.0, -1.0])
    for point in points[::10]:
        above = np.array([*point[:2], 1.0])
        distance_down = mujoco.mj_ray(rest.model, rest.data, above, down, None, 1, -1, None)
        assert 1.0 - distance_down < point[2]


def test_a_cloth_hangs_over_the_border_of_a_heightfield():
    heights = np.random.default_rng(0).random((11, 11))
    hangs = scene(
        sheet(16, 16, center=(0.0, 0.0, 0.05), fabric=WOVEN),
        scenery=HEIGHTS.format("").replace(".01", "1"),
        extra=heights_asset(heights, 0.12, 0.01),
    )
    hangs.step(100)
    points = points_of(hangs)
    inside = (np.abs(points[:, :2]) < 0.12).all(axis=1) & (points[:, 2] < 0.0)
    assert not inside.any() and points[:, 2].min() < -0.05


# ------------------------------------------------------------------ models


def test_a_heightfield_may_change_between_steps():
    heights = np.zeros((5, 5))
    heights[0, 0] = 1.0
    rest = scene(
        sheet(4, 4, center=(0.0, 0.0, RADIUS)),
        scenery=HEIGHTS.format(""),
        extra=heights_asset(heights, 0.3, 0.1),
    )
    rest.step(5)
    rest.model.hfield_data[:] = 0.05  # The ground rises by 5 mm.
    rest.step(20)
    np.testing.assert_allclose(rest.positions()[:, 2], 0.005 + RADIUS, atol=2e-4)


@pytest.mark.parametrize("ground", ["mesh", "heightfield"])
def test_runs_and_instruction_sets_agree_to_the_bit(ground, monkeypatch):
    solid, asset = MESH.format(""), mesh_asset(*solid_meshes.bunny())
    if ground == "heightfield":
        heights = np.random.default_rng(0).random((11, 11))
        solid, asset = HEIGHTS.format(""), heights_asset(heights, 0.2, 0.05)
    ends = []
    for kind in ("scalar", "avx2", "avx2"):
        monkeypatch.setenv("SOFTGYM_MJ_SIMD", kind)
        falls = scene(sheet(8, 8, center=(0.01, 0.0, 0.18)), scenery=solid, extra=asset)
        falls.step(40)
        ends.append(falls.data.qpos)
    assert (ends[0] == ends[1:]).all()


BOX = trimesh.creation.box([0.1] * 3)


@pytest.mark.parametrize(
    ("vertices", "faces", "expected"),
    [
        (BOX.vertices, BOX.faces[:-1], "a closed mesh"),
        (BOX.vertices, [*BOX.faces[:-1], BOX.faces[-1, ::-1]], "a closed mesh"),
        (30 * BOX.vertices, BOX.faces, "a mesh whose box has at most 0.5 m"),
    ],
    ids=["open", "turned", "large"],
)
def test_unsuitable_meshes_are_compile_errors(vertices, faces, expected):
    asset = mesh_asset(vertices, np.array(faces)).replace("<mesh ", '<mesh inertia="shell" ')
    with pytest.raises(ValueError, match=f'geom "solid" cannot touch a flex: expected {expected}'):
        mujoco.MjModel.from_xml_string(model_xml(sheet(4, 4), scenery=MESH.format(""), extra=asset))
