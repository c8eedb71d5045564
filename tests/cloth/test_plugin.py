"""The cloth plugin as a part of MuJoCo: what is not finite, frames, several flexes, errors.

That its state is MuJoCo's is tested with that of water: `tests/native/test_state.py`.
"""

import mujoco
import numpy as np
import pytest

from softgym_mj.cloth import solver
from tests.cloth.flex_scene import GRAVITY, RADIUS, FlexScene, model_xml, rope, sheet, straight
from tests.native.test_state import BOXES, FULL, disturbed, drive, pile, state_of

FLAT = sheet(8, 8)


# ------------------------------------------------------------------ what is not finite


@pytest.mark.parametrize(
    ("what", "value"),
    [("QPOS", np.nan), ("QPOS", np.inf), ("QVEL", np.nan), ("QVEL", np.inf), ("QVEL", 1e300)],
)
def test_a_bad_position_or_velocity_is_left_to_mujoco(what, value):
    model = pile()
    data = disturbed(model, 10)
    getattr(data, what.lower())[10] = value
    drive(model, data, 3)
    assert data.warning[getattr(mujoco.mjtWarning, f"mjWARN_BAD{what}")].number == 1
    assert np.isfinite(data.qpos).all() and np.isfinite(data.plugin_state).all()


@pytest.mark.parametrize("speed", [1e3, 1e5, 1e8])
def test_absurd_speeds_end_in_numbers_or_warnings(speed):
    model = pile()
    data = disturbed(model, 10)
    data.qvel[:] = np.random.default_rng(0).normal(0, speed, model.nv)
    drive(model, data, 20)
    assert np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()
    # It still works.
    mujoco.mj_resetData(model, data)
    np.testing.assert_array_equal(drive(model, data, 5), drive(model, mujoco.MjData(model), 5))


# ------------------------------------------------------------------ frames


def vertices(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """In the world, now."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_flex(model, data)
    return data.flexvert_xpos.copy()


@pytest.mark.parametrize("turn", ["0 180 0", "20 30 40"])
def test_a_turned_and_moved_parent_changes_nothing(turn):
    """The same two sheets: the world is turned the other way, so that they are where they were."""
    flexes = sheet(6, 6, center=(0, 0, 0.2)), sheet(6, 6, center=(0.02, 0.01, 0.25))
    plain = mujoco.MjModel.from_xml_string(model_xml(*flexes))
    data = mujoco.MjData(plain)
    mujoco.mj_step(plain, data, 60)
    expected = vertices(plain, data)
    parent = f'name="parent" pos=".3 -.2 .1" euler="{turn}"'
    turned = mujoco.MjModel.from_xml_string(model_xml(*flexes, parent=parent))
    # Vertices are bodies in the parent's frame: put them where they are in the plain model.
    other = mujoco.MjData(turned)
    mujoco.mj_forward(turned, other)
    rotation = other.body("parent").xmat.reshape(3, 3)
    origin = other.body("parent").xpos
    start = plain.body_pos[plain.flex_vertbodyid]
    bodies = turned.flex_vertbodyid
    local = (start - origin) @ rotation
    other.qpos[:] = (local - turned.body_pos[bodies]).ravel()
    np.testing.assert_allclose(vertices(turned, other), start, atol=1e-12)
    mujoco.mj_step(turned, other, 60)
    np.testing.assert_allclose(vertices(turned, other), expected, atol=1e-4)


def test_a_parent_that_moves_carries_pinned_vertices():
    """A sheet pinned by one side to a sled, which drags it over the floor."""
    flex = sheet(6, 6, center=(0, 0, RADIUS + 0.001), inside='<pin id="0 6 12 18 24 30"/>')
    model = mujoco.MjModel.from_xml_string(
        model_xml(flex, parent='name="sled"').replace(
            '<body name="sled">',
            '<body name="sled"><joint name="sled" type="slide" axis="-1 0 0"/>'
            '<geom type="sphere" size=".02" pos="-1 0 .5" mass="50"/>',
        )
    )
    data = mujoco.MjData(model)
    data.qvel[0] = 0.5
    mujoco.mj_step(model, data, 100)
    points = vertices(model, data).reshape(6, 6, 3)
    # It has been braked by the cloth a little only.
    assert data.qpos[0] == pytest.approx(0.5, abs=0.01)
    np.testing.assert_allclose(np.diff(points[:, :, 0], axis=1), 0.03, atol=0.003)
    np.testing.assert_allclose(points[:, 0, 0], -0.075 - data.qpos[0], atol=1e-6)


# ------------------------------------------------------------------ what holds vertices


PINNED = '<pin id="0 8 72 80"/>'
TIES = "<equality>" + "".join(
    f'<connect body1="a_{v}" anchor="0 0 0" solref=".01 1" solimp=".99 .999 .001"/>'
    for v in (0, 8, 72, 80)
) + "</equality>"  # fmt: skip


@pytest.mark.parametrize(("pins", "ties"), [(PINNED, ""), ("", TIES)], ids=["pins", "equalities"])
def test_a_hammock_holds_what_falls_on_it(pins, ties):
    lower = sheet(9, 9, center=(0, 0, 0.3), inside=pins)
    upper = sheet(5, 5, center=(0, 0, 0.35))
    model = mujoco.MjModel.from_xml_string(model_xml(lower, upper, floor=False, extra=ties))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 200)
    points = vertices(model, data)
    np.testing.assert_allclose(points[[0, 8, 72, 80], 2], 0.3, atol=1e-3)
    below = points[:81].reshape(9, 9, 3)[2:7, 2:7, 2].mean()
    assert points[81:, 2].mean() - below == pytest.approx(2 * RADIUS, abs=0.003)
    assert 0.1 < below < 0.3


def test_a_welded_vertex_follows_what_it_is_welded_to():
    sled = """<body name="sled" mocap="true" pos="-.075 -.075 .2"><geom type="sphere" size=".01"
      contype="0" conaffinity="0"/></body>"""
    weld = '<equality><weld body1="a_0" body2="sled" solref=".02 1"/></equality>'
    flex = sheet(6, 6, center=(0, 0, 0.2))
    model = mujoco.MjModel.from_xml_string(model_xml(flex, scenery=sled, extra=weld))
    data = mujoco.MjData(model)
    for _ in range(100):
        data.mocap_pos[0, 0] += 0.003
        mujoco.mj_step(model, data)
    mujoco.mj_step(model, data, 50)
    np.testing.assert_allclose(vertices(model, data)[0], data.mocap_pos[0], atol=2e-3)
    assert np.linalg.norm(vertices(model, data) - data.mocap_pos[0], axis=1).max() < 0.25


def test_a_held_vertex_goes_where_its_velocity_takes_it():
    scene = FlexScene(FLAT, scenery=BOXES)
    scene.hold(0, 63)
    scene.step(50, (0.3, 0.1, 0.4))
    for vertex, goal in scene.held.items():
        np.testing.assert_allclose(scene.positions()[vertex], goal, atol=1e-9)


def test_a_restored_mjdata_knows_how_hard_held_vertices_are_pulled():
    scene = FlexScene(FLAT, floor=False)
    scene.hold(0)
    scene.step(50)
    force = solver.holding_force(scene.model, scene.data, 0)
    weight = (scene.mass.sum() - scene.mass[0]) * GRAVITY
    assert 0.2 * weight < force < 5 * weight
    other = mujoco.MjData(scene.model)
    mujoco.mj_setState(scene.model, other, state_of(scene.model, scene.data), FULL)
    assert solver.holding_force(scene.model, other, 0) == force


# ------------------------------------------------------------------ several flexes


def test_flexes_with_instances_of_their_own_touch_each_other():
    """Sheet upon sheet, and a rope on both."""
    line = rope(straight(9, 0.02, (-0.08, 0.0, 0.1)), radius=0.004)
    scene = FlexScene(sheet(7, 7), sheet(6, 6, center=(0.0, 0.0, 0.05)), line, hit_interval=5)
    scene.step(150)
    assert scene.hits == 0
    lower, upper, above = np.split(scene.positions()[:, 2], [49, 49 + 36])
    assert lower.reshape(7, 7)[2:5, 2:5].mean() == pytest.approx(RADIUS, abs=1e-3)
    assert upper.reshape(6, 6)[1:5, 1:5].mean() == pytest.approx(3 * RADIUS, abs=1.5e-3)
    assert np.median(above) == pytest.approx(4 * RADIUS + 0.004, abs=1.5e-3)


def test_a_cord_does_not_fall_through_a_cord():
    low = rope(straight(17, 0.02, (-0.16, 0.0, 0.01)), radius=0.004)
    high = rope(straight(17, 0.02, (-0.16, 0.0, 0.05))[:, [1, 0, 2]], radius=0.004)
    scene = FlexScene(low, high)
    scene.step(100)
    x = scene.positions()
    assert x[17:, 2].max() - 0.004 == pytest.approx(0.008, abs=1e-3)
    assert x[:17, 2].min() == pytest.approx(0.004, abs=5e-4)


def test_each_flex_has_the_material_of_its_own_instance():
    """Two ropes that hang side by side, one ten times as stretchy."""
    points = straight(21, 0.0125)
    stiff, soft = rope(points), rope(points + [0, 1, 0], stretch=50)
    scene = FlexScene(stiff, soft, floor=False)
    x = scene.positions()
    scene.place(np.column_stack([0 * x[:, 0], x[:, 1], -x[:, 0]]))
    scene.hold(0, 21)
    scene.step(300)
    first, second = scene.strain().reshape(2, 20).mean(axis=1)
    assert second == pytest.approx(10 * first, rel=0.02)


# ------------------------------------------------------------------ contacts


TABLE = '<geom name="table" type="box" size=".2 .2 .05" pos="0 0 .05" friction="1" {}/>'


def test_contacts_with_a_table_add_up_to_the_weight():
    scene = FlexScene(sheet(8, 8, center=(0, 0, 0.106)), scenery=TABLE.format(""))
    scene.step(100)
    forces = []
    for _ in range(20):
        scene.step()
        contacts = solver.contacts(scene.model, scene.data)
        forces.append(contacts["force"].sum(axis=0))
        assert (contacts["geom"] == scene.model.geom("table").id).all()
        np.testing.assert_allclose(contacts["weight"].sum(axis=1), 1.0, atol=1e-5)
        assert (contacts["normal"][:, 2] > 0.99).all()
    weight = scene.mass.sum() * GRAVITY
    np.testing.assert_allclose(np.mean(forces, axis=0), [0, 0, weight], atol=0.02 * weight)


@pytest.mark.parametrize(
    ("bits", "touches"),
    [('contype="0" conaffinity="0"', False), ('contype="4" conaffinity="4"', False),
     ('contype="1" conaffinity="0"', True), ('contype="0" conaffinity="1"', True)],
)  # fmt: skip
def test_what_touches_is_what_contype_and_conaffinity_say(bits, touches):
    scene = FlexScene(sheet(8, 8, center=(0, 0, 0.106)), scenery=TABLE.format(bits))
    scene.step(60)
    assert (scene.positions()[:, 2].min() > 0.1) == touches


# ------------------------------------------------------------------ errors


NUMBERS = ["stretch", "stiffening", "shear", "bend", "bend_weft", "bend_bias", "stretch_damping",
           "bend_damping", "friction", "drag", "contype", "conaffinity",
           "substeps", "sweeps", "contact_stiffness",
           "contact_damping"]  # fmt: skip


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [(key, "-1", f"{key}=.*-1.*expected a") for key in NUMBERS]
    + [("bend", value, f"bend=.*{value}.*expected a") for value in ("nan", "many", "1 2", "1e999")]
    + [(key, "2.5", f"{key}=.*whole number")
       for key in ("substeps", "sweeps", "contype", "conaffinity")]
    + [("thickness", "1", "thickness")],
)  # fmt: skip
def test_a_bad_attribute_is_a_compile_error_that_names_it(key, value, message):
    with pytest.raises(ValueError, match=message):
        mujoco.MjModel.from_xml_string(model_xml(sheet(4, 4, material={key: value})))


MESH = """<geom name="rock" type="mesh" mesh="rock" {}/>"""
ROCK = '<asset><mesh name="rock" vertex="0 0 0  .1 0 0  0 .1 0  0 0 .1"/></asset>'
CUBE = """<mujoco><extension><plugin plugin="softgym_mj.cloth"><instance name="a"/></plugin>
</extension><worldbody><flexcomp name="a" type="grid" dim="3" count="3 3 3" mass="1" radius=".01"
spacing=".03 .03 .03"><contact selfcollide="none" contype="0" conaffinity="0"/>
<plugin plugin="softgym_mj.cloth" instance="a"/></flexcomp></worldbody></mujoco>"""


# Vertices of MuJoCo's own kinds, which cannot go everywhere.
RAILS = """<mujoco><extension><plugin plugin="softgym_mj.cloth"><instance name="a"/></plugin>
</extension><worldbody><body name="b"><flexcomp name="a" type="grid" dim="2" count="4 4 1" mass="1"
radius=".01" spacing=".03 .03 .03" dof="{dof}"><edge damping="1e-12"/>
<contact selfcollide="none" contype="0" conaffinity="0"/>
<plugin plugin="softgym_mj.cloth" instance="a"/></flexcomp></body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("xml", "expected"),
    [
        *((model_xml(sheet(4, 4, contact=contact)), 'flex "a" would collide twice')
          for contact in ('selfcollide="none" contype="1" conaffinity="0"',
                          'selfcollide="none" contype="0" conaffinity="1"',
                          'selfcollide="auto" contype="0" conaffinity="0"')),
        (model_xml(sheet(4, 4, edge='equality="true"')), 'flex "a" would be stretched twice'),
        (model_xml(FLAT).replace('<plugin plugin="softgym_mj.cloth" instance="a"/>', ""),
         "no flex carries it"),
        (model_xml(FLAT, option='integrator="RK4"'), "RK4 is not supported"),
        (CUBE, 'flex "a" cannot be handled: .*dimension 1 or 2'),
        *((RAILS.format(dof=dof), 'flex "a" cannot be handled: vertex . slides .*dof="full"')
          for dof in ("2d", "radial")),
    ],
    ids=["contype", "conaffinity", "selfcollide", "equality", "no flex", "RK4", "dim 3", "2d",
         "radial"],
)  # fmt: skip
def test_an_unsuitable_model_is_a_compile_error_that_says_why(xml, expected):
    with pytest.raises(ValueError, match=expected):
        mujoco.MjModel.from_xml_string(xml)


def test_a_mesh_that_does_not_touch_flexes_is_welcome():
    xml = model_xml(FLAT, scenery=MESH.format('contype="0" conaffinity="0"'), extra=ROCK)
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 5)
    assert data.warning.number.sum() == 0


@pytest.mark.parametrize("integrator", ["implicit", "implicitfast", "discrete"])
def test_the_other_integrators_move_a_cloth_alike(integrator):
    """MuJoCo's own part of it is free fall."""
    ends = []
    for name in ("Euler", integrator):
        option = f'integrator="{name}"'
        model = mujoco.MjModel.from_xml_string(model_xml(FLAT, option=option))
        data = mujoco.MjData(model)
        data.qvel[:] = np.random.default_rng(0).normal(0, 0.1, model.nv)
        mujoco.mj_step(model, data, 30)
        ends.append(data.qpos.copy())
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-4)
