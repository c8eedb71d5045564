"""Looks: what is drawn differs, what happens does not."""

import itertools

import mujoco
import numpy as np
import pytest
from scipy import ndimage

import softgym_mj
from softgym_mj.entities.arena import Arena
from softgym_mj.entities.cup import Cup
from softgym_mj.entities.cup_size import CupSize, cup_mesh
from softgym_mj.exceptions import InvalidArgumentError
from softgym_mj.rendering import CameraView
from softgym_mj.rendering.drawing import MAX_GEOMS, show_surfaces
from softgym_mj.rendering.look import FAST, LOOKS, PAPER, look_of
from softgym_mj.rendering.skins import closed, refined, spline
from softgym_mj.rendering.surfaces import find_surfaces
from softgym_mj.rendering.textures import PAD, STRIP, plaster, weave

TASKS = (
    "fold_cloth", pytest.param("rope_configuration", marks=pytest.mark.long), "pour_water_amount"
)  # fmt: skip


def pixels(asset):
    """The image (height, width, 3) of a texture, 0..1."""
    import imageio.v3 as imageio

    return imageio.imread(asset.contents, extension=".png") / 255.0


def manifold(faces):
    """Whether each edge of a mesh has two triangles that turn along it in opposite directions."""
    edges = np.concatenate([faces[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    there = {tuple(edge) for edge in edges.tolist()}
    return len(there) == len(edges) and all((b, a) in there for a, b in there)


def volume(vertices, faces):
    return np.linalg.det(vertices[faces]).sum() / 6.0


# ------------------------------------------------------------------ states


@pytest.mark.parametrize("task", TASKS)
def test_states_are_the_same_bits_under_every_look(task):
    physics = {}
    for look in LOOKS:
        env = softgym_mj.load(task, split="all", fidelity="fast", look=look)
        env.reset(803)
        random = np.random.default_rng(0)
        view = CameraView("task", 32, 32, passes=1)
        for _ in range(4):
            env.step(random.uniform(-1, 1, env.action_spec().shape))
            view.rgb(env.physics)
        assert look_of(env.physics.model.ptr) is LOOKS[look]
        physics[look] = env.get_state().physics
    first, *others = physics.values()
    for other in others:
        np.testing.assert_array_equal(first, other)


def test_another_look_is_refused():
    with pytest.raises(InvalidArgumentError, match=r"look='pretty'.*fast.*paper"):
        softgym_mj.load("fold_cloth", look="pretty")


# ------------------------------------------------------------------ meshes


@pytest.mark.parametrize(("number", "finer"), [(3, 2), (4, 4), (21, 4)])
def test_splines_go_through_the_ends_and_keep_lines(number, finer):
    places = np.linspace(0, number - 1, (number - 1) * finer + 1)
    weights = spline(number, places)
    assert weights.min() >= 0.0
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(weights @ np.arange(number), places, atol=1e-12)
    np.testing.assert_allclose(weights[[0, -1]], np.eye(number)[[0, -1]], atol=1e-12)
    # Known: a point, its neighbors: 1/6, 4/6, 1/6.
    if number > 4:
        np.testing.assert_allclose(weights[2 * finer, 1:4], [1 / 6, 4 / 6, 1 / 6])


def test_subdivision_keeps_a_plane_and_has_loops_weights():
    # A hexagon around a vertex.
    angles = np.arange(6) * np.pi / 3
    points = np.vstack([[0.0, 0.0], np.column_stack([np.cos(angles), np.sin(angles)])])
    triangles = np.array([[0, i + 1, (i + 1) % 6 + 1] for i in range(6)])
    weights, finer = refined(len(points), triangles)
    weights = weights.toarray()
    assert len(finer) == 4 * len(triangles) and weights.min() >= 0.0
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(weights[0], [5 / 8, *[1 / 16] * 6])
    np.testing.assert_allclose(weights[1], [0, 3 / 4, 1 / 8, 0, 0, 0, 1 / 8])
    inner = weights[7:][(weights[7:, 0] == 0.375)]
    assert len(inner) == 6 and np.all(
        np.sort(inner, axis=1)[:, -4:] == [0.125, 0.125, 0.375, 0.375]
    )
    a, b, c = (weights @ points)[finer].transpose(1, 0, 2)
    assert np.all(np.linalg.det(np.stack([b - a, c - a], axis=-1)) > 0.0)


@pytest.mark.parametrize("look", LOOKS.values(), ids=LOOKS)
def test_cloth_is_drawn_closed_where_its_vertices_are(look):
    env = softgym_mj.load("fold_cloth", split="all", look=look.name)
    env.reset(806)
    cloth, model, data = env.task.cloth, env.physics.model.ptr, env.physics.data.ptr
    skin = model.skin("cloth/skin").id
    assert manifold(model.skin_face)
    random = np.random.default_rng(0)
    points = cloth.flat() + random.uniform(-0.01, 0.01, (cloth.num_points, 3))
    cloth.set_points(points)
    mujoco.mj_kinematics(model, data)
    scene = mujoco.MjvScene(model, MAX_GEOMS)
    model.skin_inflate[skin] = 0.0
    everything = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(
        model, data, mujoco.MjvOption(), None, mujoco.MjvCamera(), everything, scene
    )
    drawn = scene.skinvert.reshape(-1, 3)[: model.skin_vertnum[skin]]
    front, back = np.split(drawn, 2)
    np.testing.assert_allclose(front, back, atol=1e-6)
    weights, _, _ = cloth._skin(look.refinement)
    np.testing.assert_allclose(front, weights @ points, atol=1e-6)
    corners = points[cloth.corners]
    distances = np.linalg.norm(front[:, None] - corners, axis=2)
    np.testing.assert_allclose(distances.min(axis=0), 0.0, atol=1e-6)


def test_a_closed_sheet_is_a_manifold():
    faces = np.array([[0, 1, 2], [2, 1, 3], [2, 3, 4]])
    assert manifold(closed(faces, 5))


@pytest.mark.parametrize("size", [CupSize(0.2, 0.3, 0.25, 0.01), CupSize(0.1, 0.1, 0.3, 0.02)])
def test_a_cup_is_one_closed_surface_of_its_measures(size):
    vertices, faces = cup_mesh(size)
    assert manifold(faces)
    length, width, height, wall = size.length, size.width, size.height, size.wall
    high = height + wall / 2
    inside = length * width * (height - wall / 2)
    exact = (length + 2 * wall) * (width + 2 * wall) * high - inside
    assert volume(vertices, faces) == pytest.approx(exact, rel=0.1)  # Edges are rounded.
    np.testing.assert_allclose(
        np.ptp(vertices, axis=0), [length + 2 * wall, width + 2 * wall, high], atol=1e-9
    )


@pytest.mark.parametrize("look", LOOKS.values(), ids=LOOKS)
def test_surfaces_are_written_into_their_skins(look):
    for task in ("straighten_rope", "transport_water"):
        env = softgym_mj.load(task, split="all", fidelity="fast", look=look.name)
        env.reset(800)
        model, data = env.physics.model.ptr, env.physics.data.ptr
        (surface,) = find_surfaces(model, data, look)
        vertices = np.full((model.nskinvert, 3), np.nan, np.float32)
        normals = vertices.copy()
        surface.write(vertices, normals)
        points = env.task.points()
        assert np.isfinite(vertices).all()
        used = vertices[vertices.any(axis=1)]
        assert np.all(used.min(axis=0) < points.min(axis=0))
        assert np.all(used.max(axis=0) > points.max(axis=0))


# ------------------------------------------------------------------ textures


@pytest.mark.parametrize("look", LOOKS.values(), ids=LOOKS)
def test_a_weave_has_two_sides_and_a_strip(look):
    front, back = (0.8, 0.1, 0.3), (0.9, 0.8, 0.5)
    image = pixels(weave(look, (front, back), True))
    size = look.texture_size
    assert image.shape == (size, 2 * size, 3)
    place = (np.arange(size) + 0.5) / size
    within = (place - PAD) / (1 - 2 * PAD)
    strip = (within > STRIP[0] + 0.01) & (within < STRIP[1] - 0.01)
    plain = (within > STRIP[1] + 0.01) & (within < 0.95)
    middle = (within > 0.05) & (within < 0.95)
    for columns, own, other in ((slice(0, size), front, back), (slice(size, None), back, front)):
        panel = image[:, columns][middle]
        for part, color in ((plain, own), (strip, other)):
            mean = panel[:, part].mean(axis=(0, 1))
            np.testing.assert_allclose(mean / mean.max(), np.array(color) / max(color), atol=0.02)
    assert weave(look, (front, back), True).contents == weave(look, (front, back), True).contents


def test_seeds_make_textures():
    color = (0.5, 0.5, 0.5)
    first, second = (pixels(plaster(64, color, seed)) for seed in (0, 1))
    assert np.abs(first - second).max() > 0.0
    plaster.cache_clear()
    np.testing.assert_array_equal(pixels(plaster(64, color, 0)), first)
    assert first.std() < 0.01


# ------------------------------------------------------------------ light


def test_the_mean_of_passes_has_soft_shadows_and_is_the_same_again():
    arena = Arena("straighten_rope", look=PAPER)
    arena.add_solid("sphere", size=[0.08], pos=[0.0, 0.0, 0.4])
    physics = arena.compile(0.01)
    seen = CameraView("task", 96, 96).segmentation(physics)[..., 0]
    table = ndimage.binary_erosion(seen == physics.model.ptr.geom("table").id, iterations=3)
    hard, soft, again = (
        CameraView("task", 96, 96, passes).rgb(physics).mean(axis=2) for passes in (1, 16, 16)
    )
    np.testing.assert_array_equal(soft, again)
    steepest = [
        np.abs(np.diff(image, axis=0))[table[1:] & table[:-1]].max() for image in (hard, soft)
    ]
    assert steepest[0] > 2 * steepest[1] > 0


def test_glass_casts_no_shadow():
    arena = Arena("pour_water")
    cup = Cup(CupSize(0.2, 0.2, 0.2, 0.02))
    cup.join(arena)
    physics = arena.compile(0.01, cup)
    empty = Arena("pour_water").compile(0.01)
    views = [CameraView("task", 96, 96).rgb(p).astype(int) for p in (physics, empty)]
    mask = CameraView("task", 96, 96).segmentation(physics)[..., 0]
    glass = mask == physics.model.ptr.geom("cup/glass").id
    assert glass.sum() > 100
    difference = np.abs(views[0] - views[1]).max(axis=2)
    assert difference[~glass].max() < 40 and np.mean(difference[~glass] > 8) < 0.02


def test_every_look_is_finer_than_the_one_before():
    for coarse, fine in itertools.pairwise(LOOKS.values()):
        assert fine.refinement > coarse.refinement and fine.passes > coarse.passes
        assert fine.texture_size > coarse.texture_size and fine.water_cell < coarse.water_cell
    assert LOOKS == {"fast": FAST, "paper": PAPER}


def test_other_viewers_show_what_only_our_cameras_draw():
    """Ropes as capsules, water as the plugin's triangles: those skins they cannot move."""
    for task in ("straighten_rope", "transport_water"):
        env = softgym_mj.load(task, split="all", fidelity="fast")
        env.reset(800)
        model, data = env.physics.model.ptr, env.physics.data.ptr
        kinds = []
        for own in (False, True):
            option, scene = mujoco.MjvOption(), mujoco.MjvScene(model, 10_000)
            if own:
                show_surfaces(option)
            everything = mujoco.mjtCatBit.mjCAT_ALL
            mujoco.mjv_updateScene(model, data, option, None, mujoco.MjvCamera(), everything, scene)
            kinds.append({geom.type for geom in scene.geoms[: scene.ngeom]})
        drawn = mujoco.mjtGeom.mjGEOM_FLEX, mujoco.mjtGeom.mjGEOM_TRIANGLE
        assert kinds[0] & set(drawn) and mujoco.mjtGeom.mjGEOM_SKIN not in kinds[0]
        assert mujoco.mjtGeom.mjGEOM_SKIN in kinds[1] and not kinds[1] & set(drawn)


def test_no_speckles_are_on_the_table():
    """Far from what throws shadows the table is lit everywhere."""
    env = softgym_mj.load("fold_cloth", split="all", observation="reduced")
    env.reset(806)
    view = CameraView("left", 256, 256)
    image, depth = view.rgb(env.physics), view.depth(env.physics)
    rows, columns = np.indices(depth.shape)
    pixels = np.column_stack([columns.ravel(), rows.ravel()])
    points = view.calibration(env.physics).unproject(pixels, depth.ravel())
    far = (np.hypot(*points[:, :2].T) > 0.9) & (abs(points[:, 2]) < 0.01)
    assert far.sum() > 5000
    assert image.reshape(-1, 3)[far].max(axis=1).min() > 160
