"""The plugin that moves flexes as a part of MuJoCo: errors, state, threads, frames, several flexes.

What holds to the bit is compared to the bit: positions, velocities and the plugin's own state.
"""

import concurrent.futures
import copy
import os
import pickle
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from dm_control import mujoco as dm_mujoco
from mujoco import rollout

from softgym_mj.cloth import solver
from softgym_mj.native.library import load_plugin
from tests.cloth.flex_scene import (
    GRAVITY,
    RADIUS,
    FlexScene,
    model_xml,
    rope,
    sheet,
    straight,
)

load_plugin()

STEPS = 40
FULL = mujoco.mjtState.mjSTATE_INTEGRATION
FLAT = sheet(8, 8)
# A box that falls, and one that a servo pushes to and fro.
BOXES = """
<body pos=".02 .01 .3"><freejoint/>
  <geom type="box" size=".04 .03 .02" mass=".2" friction="1"/></body>
<body pos="-.3 0 .03"><joint name="push" axis="1 0 0" type="slide"/>
  <geom type="box" size=".02 .1 .02" mass=".5" friction="1"/></body>"""
SERVO = '<actuator><position joint="push" kp="400" kv="20"/></actuator>'
WITH_BOXES = pytest.mark.parametrize("boxes", [False, True], ids=["alone", "boxes"])
AT_REST = pytest.mark.parametrize("start", [20, 250], ids=["falling", "at rest"])


# ------------------------------------------------------------------ scenes


def heap(boxes: bool = True) -> mujoco.MjModel:
    """Two sheets that fall onto the floor and each other."""
    upper = sheet(8, 8, centre=(0.02, 0.01, 0.12))
    lower = sheet(9, 9, centre=(0.0, 0.0, 0.03))
    settings = {"scenery": BOXES, "extra": SERVO} if boxes else {}
    return mujoco.MjModel.from_xml_string(model_xml(lower, upper, **settings))


def crumpled(model: mujoco.MjModel, steps: int, seed: int = 0) -> mujoco.MjData:
    """An mjData of `heap` some steps after it was thrown into disorder."""
    data = mujoco.MjData(model)
    random = np.random.default_rng(seed)
    slides = model.flex_vertbodyid
    for dof in model.body_dofadr[slides]:
        data.qvel[dof : dof + 3] = random.normal(0, 0.6, 3)
    drive(model, data, steps)
    return data


def drive(model: mujoco.MjModel, data: mujoco.MjData, steps: int = STEPS) -> np.ndarray:
    """States after each of some steps; the servo, if there is one, goes to and fro."""
    states = []
    for _ in range(steps):
        if model.nu:
            data.ctrl[0] = 0.25 * np.sin(3.0 * data.time)
        mujoco.mj_step(model, data)
        states.append(np.concatenate([data.qpos, data.qvel, data.plugin_state]))
    return np.array(states)


def coil() -> mujoco.MjModel:
    """A rope that falls in a spiral."""
    angle = 0.35 * np.arange(60)
    spiral = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle]) * 0.05
    spiral[:, 2] = 0.02 + 0.003 * np.arange(60)
    return mujoco.MjModel.from_xml_string(model_xml(rope(spiral)))


def integration_state(model, data) -> np.ndarray:
    state = np.empty(mujoco.mj_stateSize(model, FULL))
    mujoco.mj_getState(model, data, state, FULL)
    return state


def polluted(model: mujoco.MjModel) -> mujoco.MjData:
    """An mjData in which something else has happened."""
    return crumpled(model, 7, seed=5)


def python(code: str, stdin: bytes = b"", **environment: str) -> bytes:
    """What a new process writes."""
    result = subprocess.run(
        [sys.executable, "-c", code],
        input=stdin,
        capture_output=True,
        env={**os.environ, **environment},
        check=False,
    )
    assert result.returncode == 0, result.stderr.decode()
    return result.stdout


# ------------------------------------------------------------------ state


@AT_REST
@WITH_BOXES
def test_a_snapshot_continues_bit_by_bit_in_a_fresh_mjdata(boxes, start):
    model = heap(boxes)
    data = crumpled(model, start)
    state = integration_state(model, data)
    expected = drive(model, data)
    other = mujoco.MjData(model)
    mujoco.mj_setState(model, other, state, FULL)
    np.testing.assert_array_equal(drive(model, other), expected)


@AT_REST
@WITH_BOXES
def test_a_snapshot_continues_bit_by_bit_in_a_thread_that_does_other_things(boxes, start):
    model = heap(boxes)
    data = crumpled(model, start)
    state = integration_state(model, data)
    expected = drive(model, data)

    def continue_there():
        other, distraction = mujoco.MjData(model), polluted(model)
        mujoco.mj_setState(model, other, state, FULL)
        states = []
        for _ in range(STEPS):
            drive(model, distraction, 1)
            states.append(drive(model, other, 1)[0])
        return np.array(states)

    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        busy = pool.submit(lambda: drive(model, polluted(model), 2 * STEPS))
        found = pool.submit(continue_there).result()
        busy.result()
    np.testing.assert_array_equal(found, expected)


_ELSEWHERE = """
import pickle, sys
import mujoco
from tests.cloth.test_plugin import FULL, drive  # Loads the plugin.
model, state = pickle.load(sys.stdin.buffer)
data = mujoco.MjData(model)
mujoco.mj_setState(model, data, state, FULL)
sys.stdout.buffer.write(drive(model, data).tobytes())
"""


@AT_REST
@WITH_BOXES
def test_a_snapshot_continues_bit_by_bit_in_another_process(boxes, start):
    model = heap(boxes)
    data = crumpled(model, start)
    state = integration_state(model, data)
    there = python(_ELSEWHERE, pickle.dumps((model, state)))
    assert there == drive(model, data).tobytes()


@pytest.mark.parametrize("method", ["mj_copyData", "copy", "deepcopy"])
def test_copies_continue_bit_by_bit(method):
    model = heap()
    data = crumpled(model, 20)
    if method == "mj_copyData":
        other = polluted(model)
        mujoco.mj_copyData(other, model, data)
    else:
        other = getattr(copy, method)(data)
    np.testing.assert_array_equal(drive(model, other), drive(model, data))


_UNPICKLE = """
import pickle, sys
from tests.cloth.test_plugin import *
given = sys.stdin.buffer.read()
model, first = pickle.loads(given) if given else (heap(), None)
for _ in range(1 if given else 5):
    data = first or crumpled(model, 20)
    other = pickle.loads(pickle.dumps(data))
    found = drive(model, other)
    np.testing.assert_array_equal(drive(model, data), found)
    del other, data, first
    first = None
sys.stdout.buffer.write(found.tobytes())
"""


@pytest.mark.parametrize("elsewhere", [False, True], ids=["same process", "another process"])
def test_a_pickle_continues_bit_by_bit_and_ends_well(elsewhere):
    """In a process of its own: it may end badly."""
    model = heap()
    data = crumpled(model, 20)
    found = python(_UNPICKLE, pickle.dumps((model, data)) if elsewhere else b"")
    assert found == drive(model, data).tobytes()


def test_without_the_plugins_state_a_heap_goes_on_otherwise():
    """So that what is above says something: references are a part of the state that counts."""
    model = heap(boxes=False)
    data = crumpled(model, 250)
    other = copy.deepcopy(data)
    other.plugin_state[:] = 0
    assert not np.array_equal(drive(model, data), drive(model, other))


def test_a_reset_forgets_everything():
    model = heap()
    data = polluted(model)
    mujoco.mj_resetData(model, data)
    np.testing.assert_array_equal(drive(model, data), drive(model, mujoco.MjData(model)))


def test_a_copy_between_the_halves_of_a_step_is_complete():
    """In dm_control's order: forces of the next step are computed at the end of one."""
    model = heap()
    data = crumpled(model, 20)
    mujoco.mj_step1(model, data)
    other = polluted(model)
    mujoco.mj_copyData(other, model, data)
    for _ in range(STEPS):
        for one in (data, other):
            mujoco.mj_step2(model, one)
            mujoco.mj_step1(model, one)
        np.testing.assert_array_equal(one.qpos, data.qpos)
        np.testing.assert_array_equal(one.qvel, data.qvel)


def test_dm_controls_order_of_a_step_makes_the_same_motion():
    model = heap(boxes=False)
    data = crumpled(model, 20)
    physics = dm_mujoco.Physics.from_model(dm_mujoco.wrapper.MjModel(copy.deepcopy(model)))
    state = integration_state(model, data)
    mujoco.mj_setState(physics.model.ptr, physics.data.ptr, state, FULL)
    physics.forward()
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
        physics.step()
    np.testing.assert_array_equal(physics.data.qpos, data.qpos)


@pytest.mark.parametrize("threads", [1, 2])
def test_rollouts_agree_with_a_loop(threads):
    model = heap()
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    initial = np.empty((4, mujoco.mj_stateSize(model, kind)))
    for i, row in enumerate(initial):
        mujoco.mj_getState(model, crumpled(model, 5 + 5 * i), row, kind)
    controls = np.random.default_rng(0).uniform(-0.2, 0.2, (4, STEPS, 1))
    expected = np.empty_like(initial)
    for row, control, end in zip(initial, controls, expected, strict=True):
        data = mujoco.MjData(model)
        mujoco.mj_setState(model, data, row, kind)
        for data.ctrl[:] in control:
            mujoco.mj_step(model, data)
        mujoco.mj_getState(model, data, end, kind)
    datas = [polluted(model) for _ in range(threads)]
    states, _ = rollout.rollout(model, datas, initial, controls)
    np.testing.assert_array_equal(states[:, -1], expected)


def test_a_thousand_steps_twice_are_the_same_to_the_bit():
    model = heap()
    ends = [drive(model, crumpled(model, 0), 1000)[-1] for _ in range(2)]
    np.testing.assert_array_equal(ends[0], ends[1])


def test_threads_in_parallel_do_not_disturb_each_other():
    model = heap()
    expected = [drive(model, crumpled(model, 5, seed))[-1] for seed in range(4)]
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda seed: drive(model, crumpled(model, 5, seed))[-1], range(4)))
    np.testing.assert_array_equal(found, expected)


def test_two_models_take_turns_in_one_process():
    models = heap(), heap(boxes=False), coil()
    expected = [drive(model, mujoco.MjData(model)) for model in models]
    datas = [mujoco.MjData(model) for model in models]
    for step in range(STEPS):
        for model, data, states in zip(models, datas, expected, strict=True):
            np.testing.assert_array_equal(drive(model, data, 1)[0], states[step])


_SIMD = """
import sys
from tests.cloth.test_plugin import coil, crumpled, drive, heap
model = {scene}()
data = crumpled(model, 0)
sys.stdout.buffer.write(drive(model, data, {steps}).tobytes())
"""


@pytest.mark.parametrize(("scene", "steps"), [("heap", 150), ("coil", 300)])
def test_instruction_sets_agree_to_the_bit(scene, steps):
    code = _SIMD.format(scene=scene, steps=steps)
    ends = [python(code, SOFTGYM_MJ_SIMD=kind) for kind in ("scalar", "avx2")]
    assert ends[0] == ends[1]
    values = np.frombuffer(ends[0]).reshape(steps, -1)
    assert np.isfinite(values).all() and not np.array_equal(values[0], values[-1])


def test_a_restored_mjdata_knows_how_hard_held_vertices_are_pulled():
    scene = FlexScene(FLAT, floor=False)
    scene.hold(0)
    scene.step(50)
    force = solver.holding_force(scene.model, scene.data, 0)
    weight = (scene.mass.sum() - scene.mass[0]) * GRAVITY
    assert 0.2 * weight < force < 5 * weight
    other = mujoco.MjData(scene.model)
    mujoco.mj_setState(scene.model, other, integration_state(scene.model, scene.data), FULL)
    assert solver.holding_force(scene.model, other, 0) == force


# ------------------------------------------------------------------ what is not finite


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_a_bad_velocity_is_left_to_mujoco(value):
    model = heap()
    data = crumpled(model, 10)
    data.qvel[10] = value
    drive(model, data, 3)
    assert data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number == 1
    assert np.isfinite(data.qpos).all() and np.isfinite(data.plugin_state).all()


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_bad_position_is_left_to_mujoco(value):
    model = heap()
    data = crumpled(model, 10)
    data.qpos[10] = value
    drive(model, data, 3)
    assert data.warning[mujoco.mjtWarning.mjWARN_BADQPOS].number == 1
    assert np.isfinite(data.qpos).all()


@pytest.mark.parametrize("speed", [1e3, 1e5, 1e8])
def test_absurd_speeds_end_in_numbers_or_warnings(speed):
    model = heap()
    data = crumpled(model, 10)
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


@pytest.mark.parametrize("turn", ["0 0 90", "0 180 0", "90 0 0", "20 30 40"])
def test_a_turned_and_moved_parent_changes_nothing(turn):
    """The same two sheets: the world is turned the other way, so that they are where they were."""
    flexes = sheet(6, 6, centre=(0, 0, 0.2)), sheet(6, 6, centre=(0.02, 0.01, 0.25))
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
    flex = sheet(6, 6, centre=(0, 0, RADIUS + 0.001), inside='<pin id="0 6 12 18 24 30"/>')
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
    lower = sheet(9, 9, centre=(0, 0, 0.3), inside=pins)
    upper = sheet(5, 5, centre=(0, 0, 0.35))
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
    flex = sheet(6, 6, centre=(0, 0, 0.2))
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


# ------------------------------------------------------------------ several flexes


def test_flexes_with_instances_of_their_own_touch_each_other():
    """Sheet upon sheet, and a cord on both."""
    cord = rope(straight(9, 0.02, (-0.08, 0.0, 0.1)), radius=0.004)
    scene = FlexScene(
        sheet(7, 7), sheet(6, 6, centre=(0.0, 0.0, 0.05)), cord, hit_interval=1
    )  # fmt: skip
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
    scene = FlexScene(sheet(8, 8, centre=(0, 0, 0.106)), scenery=TABLE.format(""))
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
    scene = FlexScene(sheet(8, 8, centre=(0, 0, 0.106)), scenery=TABLE.format(bits))
    scene.step(60)
    assert (scene.positions()[:, 2].min() > 0.1) == touches


# ------------------------------------------------------------------ errors


def compile_with(**material) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(model_xml(sheet(4, 4, material=material)))


NUMBERS = ["stretch", "shear", "bend", "stretch_damping", "bend_damping", "friction", "drag",
           "contype", "conaffinity", "substeps", "sweeps", "contact_stiffness",
           "contact_damping"]  # fmt: skip


@pytest.mark.parametrize("key", NUMBERS)
@pytest.mark.parametrize("value", ["-1", "nan", "many", "1 2", "1e999"])
def test_a_bad_attribute_is_a_compile_error_that_names_it(key, value):
    with pytest.raises(ValueError, match=rf"{key}=.*{value}.*expected a"):
        compile_with(**{key: value})


@pytest.mark.parametrize("key", ["substeps", "sweeps", "contype", "conaffinity"])
def test_what_is_counted_is_whole(key):
    with pytest.raises(ValueError, match=rf"{key}=.*whole number"):
        compile_with(**{key: "2.5"})


def test_an_unknown_attribute_is_mujocos_error():
    with pytest.raises(ValueError, match="thickness"):
        compile_with(thickness=1)


def test_fuzzed_attributes_compile_or_say_what_is_wrong():
    random = np.random.default_rng(0)
    alphabet = list("0123456789+-.eE naifx\t")
    outcomes = {True: 0, False: 0}
    for _ in range(200):
        value = "".join(random.choice(alphabet, random.integers(1, 7)))
        key = random.choice(NUMBERS)
        try:
            model = compile_with(**{key: value})
        except ValueError as error:
            assert f"{key}=" in str(error)
            outcomes[False] += 1
        else:
            mujoco.mj_step(model, mujoco.MjData(model))
            outcomes[True] += 1
    assert min(outcomes.values()) > 5


MESH = """<geom name="rock" type="mesh" mesh="rock" {}/>"""
ROCK = '<asset><mesh name="rock" vertex="0 0 0  .1 0 0  0 .1 0  0 0 .1"/></asset>'
CUBE = """<mujoco><extension><plugin plugin="softgym_mj.cloth"><instance name="a"/></plugin>
</extension><worldbody><flexcomp name="a" type="grid" dim="3" count="3 3 3" mass="1" radius=".01"
spacing=".03 .03 .03"><contact selfcollide="none" contype="0" conaffinity="0"/>
<plugin plugin="softgym_mj.cloth" instance="a"/></flexcomp></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("xml", "expected"),
    [
        (model_xml(sheet(4, 4, contact='selfcollide="none" contype="1" conaffinity="0"')),
         'flex "a" would collide twice'),
        (model_xml(sheet(4, 4, contact='selfcollide="none" contype="0" conaffinity="1"')),
         'flex "a" would collide twice'),
        (model_xml(sheet(4, 4, contact='selfcollide="auto" contype="0" conaffinity="0"')),
         'flex "a" would collide twice'),
        (model_xml(sheet(4, 4, edge='equality="true"')), 'flex "a" would be stretched twice'),
        (model_xml(FLAT).replace('<plugin plugin="softgym_mj.cloth" instance="a"/>', ""),
         "no flex carries it"),
        (model_xml(FLAT, option='integrator="RK4"'), "RK4 is not supported"),
        (model_xml(FLAT, scenery=MESH.format(""), extra=ROCK), 'geom "rock" cannot touch a flex'),
        (CUBE, 'flex "a" cannot be handled: .*dimension 1 or 2'),
    ],
    ids=["contype", "conaffinity", "selfcollide", "equality", "no flex", "RK4", "mesh", "dim 3"],
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


@pytest.mark.parametrize("integrator", ["Euler", "implicit", "implicitfast", "discrete"])
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


def test_a_flat_sheet_lies_still_a_radius_above_the_floor():
    scene = FlexScene(FLAT)
    scene.step(100)
    np.testing.assert_allclose(scene.positions()[:, 2], RADIUS, atol=2e-4)
    np.testing.assert_allclose(scene.positions()[:, :2], FLAT.points[:, :2], atol=1e-5)
