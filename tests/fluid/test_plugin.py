"""The plugin as a part of MuJoCo: poses, errors, walls, drawing."""

import re

import mujoco
import numpy as np
import pytest

from tests.scenes.fluid_cup import MOCAP, SPACING, FluidCup


def take_a_step(cup, stepping):
    """One step, by mj_step or in the order that dm_control calls legacy."""
    if stepping == "legacy":
        mujoco.mj_step2(cup.model, cup.data)
        mujoco.mj_step1(cup.model, cup.data)
    else:
        cup.step()


@pytest.mark.parametrize("moved_by", ["mocap", "Euler", "implicitfast", "RK4"])
@pytest.mark.parametrize("stepping", ["mj_step", "legacy"])
def test_walls_are_where_the_cup_is(stepping, moved_by):
    """A wall at 0.66 m/s is 6.6 mm further at the end of a step: particles touch it there.

    The cup is a mocap body, or on a joint that an integrator moves.
    """
    joint, option = '<joint type="slide" axis="1 0 0"/>', f'integrator="{moved_by}"'
    on_joint = {"body": "", "joint": joint, "option": option} if moved_by != "mocap" else {}
    cup = FluidCup((5, 5), 5, **on_joint)
    if stepping == "legacy":
        take_a_step(cup, stepping)
    for step in range(100):
        if on_joint:
            cup.data.qvel[0] = 0.66
        else:
            cup.data.mocap_pos[0, 0] = 0.0066 * step
        take_a_step(cup, stepping)
        place = cup.data.qpos[0] if on_joint else cup.data.mocap_pos[0, 0]
        x = cup.positions[:, 0] - place
        # Hard contact at 0.3 spacings, from both sides of the half length.
        assert np.abs(x).max() <= cup.length / 2 - 0.29 * SPACING
    assert abs(x.mean()) < 0.2 * cup.length


@pytest.mark.parametrize(
    ("jump", "known", "taken"), [(1.0, 1, False), (0.05, 1, True), (0.05, 0, False)]
)
def test_a_teleport_is_not_swept(jump, known, taken):
    """A cup that jumps 1 m leaves its water behind; one that moves 5 cm takes it along.

    With the first entry of the state cleared, any move is a teleport.
    """
    cup = FluidCup((5, 5), 5)
    cup.step(50)
    before = cup.positions[:, 0].mean()
    cup.state[0] = known
    cup.data.mocap_pos[0, 0] += jump
    cup.step()
    assert (cup.positions[:, 0].mean() - before > 0.02) == taken
    assert np.abs(cup.velocities).max() < 10


def test_the_first_move_after_a_reset_is_swept():
    """Walls are swept from the pose of the last mj_forward."""
    for forward in (True, False):
        cup = FluidCup((5, 5), 5)
        if forward:
            mujoco.mj_forward(cup.model, cup.data)
        cup.data.mocap_pos[0, 0] += 0.03
        cup.step()
        assert cup.escaped().any() == (not forward)


def test_a_lattice_may_have_more_columns_than_fit_into_an_int():
    cup = FluidCup((3, 2), 2, settings={"columns": "65536 65536"})
    np.testing.assert_allclose(np.ptp(cup.positions[:, 1:], axis=0), 0, atol=0.003 * SPACING)
    cup.step()


BAD = [
    ({"count": "0"}, "count"),
    ({"count": ""}, "count (number of particles, 1 or more) is missing"),
    ({"spacing": "-0.01"}, "spacing"),
    ({"spacing": "0.018 m"}, "spacing"),
    ({"columns": "3"}, "2 whole numbers"),
    ({"corner": "0 0 inf"}, "3 numbers"),
    ({"viscosity": "-1"}, "viscosity"),
    ({"viscosity": "1"}, "expected at most 0.22"),
    ({"cohesion": "1e9"}, "cohesion"),
    ({"friction": "-0.1"}, "friction"),
    ({"density": "0"}, "density"),
    ({"substeps": "2.5"}, "substeps"),
    ({"two_way": "maybe"}, "true or false"),
    ({"world": "2"}, "true or false"),
    ({"max_speed": "0"}, "max_speed"),
    ({"draw": "blob"}, "surface, fine, particles or none"),
    ({"rgba": "1 0 0"}, "4 numbers"),
    ({"color": "blue"}, "unrecognized attribute"),
]  # fmt: skip


@pytest.mark.parametrize(("config", "message"), BAD)
def test_bad_attributes_are_compile_errors(config, message):
    with pytest.raises(ValueError, match=re.escape(message)) as error:
        FluidCup((3, 3), 3, settings=config)
    assert "water" in str(error.value)  # The instance.


def test_unsupported_walls_and_flags_are_compile_errors():
    mesh = '<geom name="odd" type="mesh" mesh="m"/>'
    asset = '<asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><worldbody>'
    cup = FluidCup((3, 3), 3)
    xml = cup.xml.replace("<worldbody>", asset).replace("</body>", mesh + "</body>")
    with pytest.raises(ValueError, match='geom "odd" cannot be a wall'):
        mujoco.MjModel.from_xml_string(xml)
    visual = mesh.replace("/>", ' contype="0" conaffinity="0" mass="0"/>')
    mujoco.MjModel.from_xml_string(xml.replace(mesh, visual))  # One to look at is no wall.
    flags = '<flag spring="disable" damper="disable"/></option>'
    xml = FluidCup((3, 3), 3, two_way="true").xml.replace(
        'timestep="0.01" />', f'timestep="0.01">{flags}'
    )
    with pytest.raises(ValueError, match="two_way"):
        mujoco.MjModel.from_xml_string(xml)


BALL = '<geom type="sphere" size="0.02" pos="0.01 0 0.03"/>'
GHOST = BALL.replace("/>", ' contype="0" conaffinity="0"/>')
CENTERED = '<geom type="sphere" size="0.02"/>'


@pytest.mark.parametrize(
    ("scenery", "walls"),
    [
        (BALL, 1),
        (f"<body>{BALL}</body>", 1),
        (f"<body>{BALL}<body>{BALL}</body></body>", 2),
        (f"<body>{GHOST}</body>", 0),
        (f"<body {MOCAP}>{BALL}<body>{BALL}</body></body>", 0),
        (f"<body><freejoint/>{BALL}<body>{BALL}</body></body>", 0),
    ],
    ids=["world", "static", "nested", "visual", "mocap", "free"],
)
def test_what_is_fixed_to_the_world_is_a_wall(scenery, walls):
    # Behind the particles the state has seven numbers a wall; the cup has five walls.
    sizes = [
        FluidCup((3, 3), 3, scenery=scenery, world=world).state.size for world in ("true", "false")
    ]
    assert sizes == [1 + 6 * 27 + 7 * (5 + walls), 1 + 6 * 27 + 7 * 5]


def test_a_fixed_body_holds_water_back_as_the_world_does():
    ends = []
    nested = f'<body pos="0.01 0 0"><body pos="0 0 0.03">{CENTERED}</body></body>'
    for scenery in ("", BALL, nested):
        cup = FluidCup((5, 5), 5, scenery=scenery)
        cup.step(100)
        ends.append(cup.positions.copy())
        center = cup.positions - [0.01, 0.0, 0.03]
        free = np.linalg.norm(center, axis=1).min()
        assert (free > 0.02 + 0.29 * SPACING) == bool(scenery)
    np.testing.assert_array_equal(ends[1], ends[2])


def test_the_flag_gravity_is_obeyed():
    cup = FluidCup((3, 3), 3)
    cup.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_GRAVITY
    cup.positions[:, 2] += 5
    before = cup.positions.mean(axis=0)
    cup.step(20)
    np.testing.assert_allclose(cup.positions.mean(axis=0), before, atol=1e-5)


def test_not_a_number_never_enters_the_state():
    cup = FluidCup((3, 3), 3)
    cup.data.mocap_pos[0, 0] = np.nan
    cup.step(3)
    assert np.isfinite(cup.state).all()


def test_two_instances_do_not_touch():
    """Two waters in one model move as each does alone."""
    cup = FluidCup((4, 4), 4)
    second = cup.xml.split("<instance")[1].split("</instance>")[0].replace('"water"', '"more"')
    both = cup.xml.replace("</instance>", f"</instance><instance{second}</instance>", 1)
    model = mujoco.MjModel.from_xml_string(both)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 20)
    cup.step(20)
    first = data.plugin_state[model.plugin_stateadr[0] :][: cup.state.size]
    np.testing.assert_array_equal(first, cup.state)
    # The second has no walls: it falls freely.
    start = model.plugin_stateadr[1] + 1
    z = data.plugin_state[start : start + 3 * cup.count].reshape(-1, 3)[:, 2]
    assert z.mean() < -0.15


def scene_of(cup, max_geom=10000):
    mujoco.mj_forward(cup.model, cup.data)
    scene = mujoco.MjvScene(cup.model, max_geom)
    mujoco.mjv_updateScene(
        cup.model, cup.data, mujoco.MjvOption(), None, mujoco.MjvCamera(),
        mujoco.mjtCatBit.mjCAT_ALL, scene,
    )  # fmt: skip
    return scene


TRIANGLE = int(mujoco.mjtGeom.mjGEOM_TRIANGLE)


def triangles_of(scene):
    """(n, 3, 3) corners of the drawn triangles."""
    geoms = [g for g in scene.geoms[: scene.ngeom] if g.type == TRIANGLE]
    mats = np.array([g.mat for g in geoms])
    first = np.array([g.pos for g in geoms])
    return np.stack([first, first + mats[:, :, 0], first + mats[:, :, 1]], axis=1)


def test_the_drawn_surface_encloses_the_water():
    volumes = {}
    for draw in ("surface", "fine"):
        cup = FluidCup((8, 8), 8, draw=draw)
        cup.step(200)
        corners = triangles_of(scene_of(cup))
        # A closed surface, oriented outwards: the divergence theorem gives its volume.
        volumes[draw] = np.linalg.det(corners).sum() / 6
        assert corners.min() > cup.positions.min() - SPACING
        edges = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
        edges = np.round(edges / (0.01 * SPACING)).astype(int).reshape(-1, 6)
        _, counts = np.unique(np.concatenate([edges, edges[:, [3, 4, 5, 0, 1, 2]]]), axis=0,
                              return_counts=True)  # fmt: skip
        assert (counts >= 2).all() and (counts % 2 == 0).mean() > 0.99
    water = cup.count * SPACING**3
    assert volumes["fine"] == pytest.approx(water, rel=0.15)
    assert volumes["surface"] == pytest.approx(water, rel=0.25)


@pytest.mark.parametrize("draw", ["surface", "fine"])
def test_a_lone_drop_is_drawn_wherever_it_is(draw):
    cup = FluidCup((1, 1), 1, draw=draw)
    for position in np.random.default_rng(0).uniform(0.5, 0.6, (20, 3)):
        cup.positions[:] = position
        corners = triangles_of(scene_of(cup, 1000))
        assert len(corners) >= 8
        np.testing.assert_allclose(corners.mean(axis=(0, 1)), position, atol=0.5 * SPACING)
        assert 0.3 * SPACING < np.ptp(corners.reshape(-1, 3), axis=0).max() < 2.2 * SPACING


@pytest.mark.parametrize("draw", ["surface", "fine", "particles"])
def test_the_water_never_crowds_out_the_model(draw):
    for max_geom in (150, 400, 1000):
        cup = FluidCup((8, 8), 8, draw=draw)
        cup.step(5)
        cup.velocities[:] = np.random.default_rng(0).normal(0, 2, (cup.count, 3))
        cup.step(20)
        scene = scene_of(cup, max_geom)
        boxes = [g for g in scene.geoms[: scene.ngeom] if g.type == mujoco.mjtGeom.mjGEOM_BOX]
        assert len(boxes) == cup.model.ngeom
        assert scene.ngeom < max_geom


def test_nothing_is_drawn_when_asked_for_nothing():
    assert scene_of(FluidCup((3, 3), 3, draw="none")).ngeom == 5
