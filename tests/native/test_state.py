"""What the plugins remember is a part of MuJoCo's state: to the bit, wherever a simulation goes on.

Of cloth, rope, water in a moving cup, and water among solids and cloth. Compared are positions,
velocities and the plugins' own state after every step.
"""

import concurrent.futures
import copy
import dataclasses
import functools
import pickle
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from dm_control import mujoco as dm_mujoco
from mujoco import rollout

from softgym_mj.native.library import load_plugin
from tests.cloth.flex_scene import model_xml, rope, sheet
from tests.fluid.test_physics import OBSTACLES, PLANE
from tests.scenes.fluid_cup import FluidCup

load_plugin()

STEPS = 40
FULL = mujoco.mjtState.mjSTATE_INTEGRATION
# A box that falls, and one that a servo pushes to and fro.
BOXES = """
<body pos=".02 .01 .3"><freejoint/>
  <geom type="box" size=".04 .03 .02" mass=".2" friction="1"/></body>
<body pos="-.3 0 .03"><joint name="push" axis="1 0 0" type="slide"/>
  <geom type="box" size=".02 .1 .02" mass=".5" friction="1"/></body>"""
SERVO = '<actuator><position joint="push" kp="400" kv="20"/></actuator>'
CLOTH = """
<flexcomp name="cloth" type="grid" dim="2" count="5 5 1" spacing=".04 .04 .04" mass=".01"
  radius=".002" pos="0 0 .09" rgba="1 1 1 1"><contact selfcollide="none"/></flexcomp>"""


# ------------------------------------------------------------------ scenes


def pile(boxes: bool = True) -> mujoco.MjModel:
    """Two sheets that fall onto the floor and each other."""
    upper = sheet(8, 8, center=(0.02, 0.01, 0.12))
    lower = sheet(9, 9, center=(0.0, 0.0, 0.03))
    settings = {"scenery": BOXES, "extra": SERVO} if boxes else {}
    return mujoco.MjModel.from_xml_string(model_xml(lower, upper, **settings))


def coil() -> mujoco.MjModel:
    """A rope that falls in a spiral."""
    angle = 0.35 * np.arange(60)
    spiral = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle]) * 0.05
    spiral[:, 2] = 0.02 + 0.003 * np.arange(60)
    return mujoco.MjModel.from_xml_string(model_xml(rope(spiral)))


def cup() -> mujoco.MjModel:
    """Water in a cup that is moved and tilted."""
    return FluidCup((5, 5), 6, two_way="true").model


def splash() -> mujoco.MjModel:
    """Viscous water with cohesion in a cup on a joint that feels it; all shapes and a cloth."""
    return FluidCup(
        (6, 6), 4, inside=OBSTACLES, scenery=PLANE + CLOTH, body="",
        joint='<joint name="tilt" axis="0 1 0" stiffness="1"/>', option='integrator="implicitfast"',
        actuator='<actuator><position joint="tilt" kp="400" kv="40"/></actuator>',
        viscosity=3e-4, cohesion=1.5, friction=0.2, two_way="true", flexes="true",
    ).model  # fmt: skip


# And after how many steps they are looked at: sheets fall, then lie still.
SCENES = {
    "falling": (pile, 20),
    "lying": (pile, 250),
    "lying alone": (functools.partial(pile, boxes=False), 250),
    "coil": (coil, 20),
    "cup": (cup, 20),
    "splash": (splash, 10),
}


def disturbed(model: mujoco.MjModel, steps: int, seed: int = 0) -> mujoco.MjData:
    """An mjData some steps after everything that moves was thrown into disorder."""
    data = mujoco.MjData(model)
    slides = model.flex_vertbodyid
    for dof in model.body_dofadr[slides]:
        data.qvel[dof : dof + 3] = np.random.default_rng(seed + dof).normal(0, 0.6, 3)
    drive(model, data, steps)
    return data


def drive(model: mujoco.MjModel, data: mujoco.MjData, steps: int = STEPS) -> np.ndarray:
    """States after each of some steps; servos and a mocap body go to and fro."""
    states = []
    for _ in range(steps):
        data.ctrl[:] = 0.25 * np.sin(3.0 * data.time)
        if model.nmocap:
            phase = 10.0 * data.time
            angle = 0.4 * np.sin(phase)
            data.mocap_pos[0] = [0.05 * np.sin(2.0 * phase), 0, 0.1 * (1 - np.cos(phase))]
            data.mocap_quat[0] = [np.cos(angle / 2), 0, np.sin(angle / 2), 0]
        mujoco.mj_step(model, data)
        states.append(np.concatenate([data.qpos, data.qvel, data.plugin_state]))
    return np.array(states)


def polluted(model: mujoco.MjModel) -> mujoco.MjData:
    """An mjData in which something else has happened."""
    data = disturbed(model, 7, seed=5)
    data.mocap_pos[:] += [3, 2, 1]
    mujoco.mj_step(model, data, 2)
    return data


def state_of(model: mujoco.MjModel, data: mujoco.MjData, kind=FULL) -> np.ndarray:
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    return state


@dataclasses.dataclass
class Midway:
    """A scene some steps after its start, and the states that follow."""

    model: mujoco.MjModel
    data: mujoco.MjData
    state: np.ndarray
    expected: np.ndarray


@functools.cache
def midway_of(name: str) -> Midway:
    build, steps = SCENES[name]
    model = build()
    data = disturbed(model, steps)
    expected = drive(model, copy.deepcopy(data))
    assert np.isfinite(expected).all() and not np.array_equal(expected[0], expected[-1])
    return Midway(model, data, state_of(model, data), expected)


@pytest.fixture(name="midway", params=SCENES)
def _midway(request):
    return midway_of(request.param)


# ------------------------------------------------------------------ copies and snapshots


def restored(midway: Midway, other: mujoco.MjData) -> mujoco.MjData:
    """`other` with the scene's state."""
    mujoco.mj_setState(midway.model, other, midway.state, FULL)
    return other


def copied(midway: Midway, other: mujoco.MjData) -> mujoco.MjData:
    """States copied by mj_copyData continue identically."""
    mujoco.mj_copyData(other, midway.model, midway.data)
    return other


COPIES = {
    "mj_setState": lambda m: restored(m, polluted(m.model)),
    "mj_copyData": lambda m: copied(m, polluted(m.model)),
    "copy": lambda m: copy.copy(m.data),
    "deepcopy": lambda m: copy.deepcopy(m.data),
    "pickle": lambda m: pickle.loads(pickle.dumps(m.data)),
}


@pytest.mark.parametrize("method", COPIES)
def test_copies_continue_bit_by_bit(midway, method):
    np.testing.assert_array_equal(drive(midway.model, COPIES[method](midway)), midway.expected)


def test_a_snapshot_continues_bit_by_bit_in_a_thread_that_does_other_things(midway):
    model = midway.model

    def continue_there():
        other, distraction = restored(midway, mujoco.MjData(model)), polluted(model)
        states = []
        for _ in range(STEPS):
            drive(model, distraction, 1)
            states.append(drive(model, other, 1)[0])
        return np.array(states)

    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        busy = pool.submit(lambda: drive(model, polluted(model), 2 * STEPS))
        found = pool.submit(continue_there).result()
        busy.result()
    np.testing.assert_array_equal(found, midway.expected)


_ELSEWHERE = """
import pickle, sys
from tests.native.test_state import *
for midway in pickle.load(sys.stdin.buffer):
    np.testing.assert_array_equal(
        drive(midway.model, restored(midway, mujoco.MjData(midway.model))), midway.expected
    )
    for _ in range(2):
        data = pickle.loads(pickle.dumps(midway.data))
        np.testing.assert_array_equal(drive(midway.model, data), midway.expected)
        del data
    np.testing.assert_array_equal(drive(midway.model, midway.data), midway.expected)
print("ended well")
"""


def test_snapshots_and_pickles_continue_bit_by_bit_in_another_process():
    """And end well: without a crash when they are freed."""
    scenes = pickle.dumps([midway_of(name) for name in SCENES])
    done = subprocess.run(
        [sys.executable, "-c", _ELSEWHERE], input=scenes, capture_output=True, check=False
    )
    assert done.returncode == 0 and done.stdout == b"ended well\n", done.stderr.decode()


def test_without_the_plugins_state_it_goes_on_otherwise(midway):
    """Checks the tests above: without the plugin state, the simulation differs."""
    other = copy.deepcopy(midway.data)
    other.plugin_state[:] = 0
    assert not np.array_equal(drive(midway.model, other), midway.expected)


def test_a_reset_forgets_everything(midway):
    data, fresh = polluted(midway.model), mujoco.MjData(midway.model)
    mujoco.mj_resetData(midway.model, data)
    np.testing.assert_array_equal(data.plugin_state, fresh.plugin_state)
    np.testing.assert_array_equal(drive(midway.model, data), drive(midway.model, fresh))


# ------------------------------------------------------------------ who steps, and how


def test_a_copy_between_the_halves_of_a_step_is_complete(midway):
    """In dm_control's order: forces of the next step are computed at the end of one."""
    model, data = midway.model, copy.deepcopy(midway.data)
    mujoco.mj_step1(model, data)
    other = polluted(model)
    mujoco.mj_copyData(other, model, data)
    for _ in range(STEPS):
        for one in (data, other):
            mujoco.mj_step2(model, one)
            mujoco.mj_step1(model, one)
        np.testing.assert_array_equal(other.qpos, data.qpos)
        np.testing.assert_array_equal(other.qvel, data.qvel)
        np.testing.assert_array_equal(other.plugin_state, data.plugin_state)


def test_dm_controls_order_of_a_step_makes_the_same_motion():
    midway = midway_of("lying alone")
    model = dm_mujoco.wrapper.MjModel(copy.deepcopy(midway.model))
    physics = dm_mujoco.Physics.from_model(model)
    mujoco.mj_setState(physics.model.ptr, physics.data.ptr, midway.state, FULL)
    physics.forward()
    for expected in midway.expected:
        physics.step()
        np.testing.assert_array_equal(physics.data.qpos, expected[: midway.model.nq])


@pytest.mark.parametrize("name", ["falling", "splash"])
def test_parallel_rollouts_agree_with_a_loop(name):
    model = midway_of(name).model
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    initial = np.array([state_of(model, disturbed(model, 5 + 5 * i), kind) for i in range(4)])
    controls = np.random.default_rng(0).uniform(-0.2, 0.2, (4, STEPS, 1))
    expected = []
    for row, control in zip(initial, controls, strict=True):
        data = mujoco.MjData(model)
        mujoco.mj_setState(model, data, row, kind)
        for data.ctrl[:] in control:
            mujoco.mj_step(model, data)
        expected.append(state_of(model, data, kind))
    states, _ = rollout.rollout(model, [polluted(model) for _ in range(2)], initial, controls)
    np.testing.assert_array_equal(states[:, -1], expected)


def test_models_take_turns_in_one_process():
    scenes = [midway_of(name) for name in SCENES]
    datas = [copy.deepcopy(scene.data) for scene in scenes]
    for step in range(STEPS):
        for scene, data in zip(scenes, datas, strict=True):
            np.testing.assert_array_equal(drive(scene.model, data, 1)[0], scene.expected[step])


@pytest.mark.parametrize(
    ("build", "steps"), [(pile, 80), (coil, 300), (splash, 40)], ids=["pile", "coil", "splash"]
)
def test_instruction_sets_agree_to_the_bit(build, steps, monkeypatch):
    model, ends = build(), []
    for kind in ("scalar", "avx2"):
        monkeypatch.setenv("SOFTGYM_MJ_SIMD", kind)
        ends.append(drive(model, disturbed(model, 0), steps))
    np.testing.assert_array_equal(ends[0], ends[1])
    assert np.isfinite(ends[0]).all() and not np.array_equal(ends[0][0], ends[0][-1])
