"""The cloth contact plugin as a part of MuJoCo: state, threads, frames, several flexes, errors."""

import copy
import os
import pathlib
import pickle
import re
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from dm_control import mujoco as dm_mujoco
from mujoco import rollout

from softgym_mj import metrics
from softgym_mj.native import library

library.load_plugin()

STEPS = 40
FULL = mujoco.mjtState.mjSTATE_INTEGRATION
RADIUS = 0.005

OPTION = (
    'timestep="0.01" integrator="discrete" solver="CG" cone="elliptic" jacobian="sparse" '
    'iterations="200" tolerance="1e-5"'
)
SHEET = """
<flexcomp name="{name}" type="grid" dim="2" count="9 9 1" spacing=".03 .03 .03" mass=".01"
  radius=".005" pos="{pos}" euler="{euler}" {pin}>
  <contact selfcollide="none" contype="0" conaffinity="1" gap=".003" friction="{friction}"/>
  <elasticity young="2e5" poisson=".2" thickness="5e-4" damping=".01" elastic2d="both"/>
  <plugin instance="contact"/>{inside}
</flexcomp>"""
CORD = """
<flexcomp name="{name}" type="grid" dim="1" count="17 1 1" spacing=".02 .02 .02" mass=".004"
  radius=".004" pos="{pos}" euler="{euler}">
  <contact selfcollide="none" contype="0" conaffinity="1" gap=".003"/>
  <edge equality="true" solref="-24000 -200" solimp=".99 .999 .001"/>
  <elasticity young="1e4" damping=".01"/><plugin instance="contact"/>
</flexcomp>"""

BLOCK = """
<flexcomp name="a" type="grid" dim="3" count="3 3 3" spacing=".03 .03 .03" mass=".1" radius=".005">
  <contact selfcollide="none"/><plugin instance="contact"/>
</flexcomp>"""


def sheet(name, pos="0 0 .1", euler="0 0 0", pin="", inside="", friction=0.8):
    return SHEET.format(name=name, pos=pos, euler=euler, pin=pin, inside=inside, friction=friction)


def cord(name, pos="0 0 .1", euler="0 0 0"):
    return CORD.format(name=name, pos=pos, euler=euler)


def model_of(
    *flexes, parent='name="parent"', config="", scenery="", option=OPTION, floor=True, ties=""
):
    """A model of flexes in one body; `config` is the plugin's."""
    plane = '<geom type="plane" size="2 2 .1" friction=".8"/>' if floor else ""
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco><option {option}/><size memory="64M"/>
    <extension><plugin plugin="softgym_mj.cloth_contact">
      <instance name="contact">{config}</instance></plugin></extension>
    <worldbody>{plane}{scenery}<body {parent}>{"".join(flexes)}</body></worldbody>
    <equality>{ties}</equality></mujoco>""")


def stack():
    """Two sheets that fall onto each other, tilted."""
    return model_of(sheet("a", "0 0 .03"), sheet("b", ".02 .01 .08", "5 3 20"))


def run(model, data, steps=STEPS):
    """Positions after every step."""
    states = []
    for _ in range(steps):
        mujoco.mj_step(model, data)
        states.append(data.qpos.copy())
    return np.array(states)


def started(model, steps=10):
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, steps)
    return data


def polluted(model):
    """An mjData in which something else has happened."""
    data = mujoco.MjData(model)
    data.qvel[:] = np.random.default_rng(0).normal(0, 0.5, model.nv)
    mujoco.mj_step(model, data, 7)
    return data


def count_crossings(model, data):
    """Intersections of all flexes with themselves and each other, at the end of a step."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_flex(model, data)
    edges, triangles = [], []
    for f in range(model.nflex):
        first = model.flex_vertadr[f]
        e = slice(model.flex_edgeadr[f], model.flex_edgeadr[f] + model.flex_edgenum[f])
        edges.append(model.flex_edge[e] + first)
        if model.flex_dim[f] == 2:
            t = model.flex_elemdataadr[f]
            corners = model.flex_elem[t : t + 3 * model.flex_elemnum[f]]
            triangles.append(corners.reshape(-1, 3) + first)
    return metrics.count_intersections(
        data.flexvert_xpos, np.concatenate(edges), np.concatenate(triangles)
    )


# ---------------------------------------------------------------------------- state and threads


def test_the_plugin_has_no_state():
    assert stack().npluginstate == 0


@pytest.mark.parametrize("method", ["set_state", "mj_copyData", "deepcopy", "pickle"])
def test_copies_continue_bit_by_bit(method):
    model = stack()
    data = started(model)
    if method == "set_state":
        state = np.empty(mujoco.mj_stateSize(model, FULL))
        mujoco.mj_getState(model, data, state, FULL)
        other = polluted(model)
        mujoco.mj_setState(model, other, state, FULL)
    elif method == "mj_copyData":
        other = polluted(model)
        mujoco.mj_copyData(other, model, data)
    elif method == "pickle":
        other = pickle.loads(pickle.dumps(data))
    else:
        other = copy.deepcopy(data)
    expected = run(model, data)
    np.testing.assert_array_equal(run(model, other), expected)


def test_what_was_stepped_before_on_the_thread_does_not_matter():
    """Two datas and a second model in turns: each as if alone."""
    model, second = stack(), model_of(sheet("a", "0 0 .05"), sheet("b", "0 0 .02", "0 0 9"))
    expected = run(model, started(model))
    data, other, another = started(model), polluted(model), polluted(second)
    for state in expected:
        mujoco.mj_step(second, another)
        mujoco.mj_step(model, other)
        mujoco.mj_step(model, data)
        np.testing.assert_array_equal(data.qpos, state)


PROP = '<body name="prop" pos="1 1 .5">{}<geom type="box" size=".05 .05 .05" mass="1"/></body>'


@pytest.mark.parametrize("last", ["free", "fixed"])
def test_models_whose_joints_differ_may_alternate_on_a_thread(last):
    """The same cloths on the same bodies, but a prop before them is free in one of the models."""
    models = {}
    for name in ("fixed", "free") if last == "free" else ("free", "fixed"):
        scenery = PROP.format("<freejoint/>" if name == "free" else "")
        models[name] = model_of(sheet("a", "0 0 .03"), sheet("b", ".02 .01 .08"), scenery=scenery)
    assert models["free"].nq == models["fixed"].nq + 7
    ends = {}
    for name, model in models.items():
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 60)
        assert data.warning.number.sum() == 0
        ends[name] = data.qpos[-3 * 162 :].copy()
        if name == "free":  # It has fallen and lies on the floor.
            assert data.qpos[:3] == pytest.approx([1, 1, 0.05], abs=1e-3)
    np.testing.assert_allclose(ends["free"], ends["fixed"], atol=1e-3)
    datas = {name: mujoco.MjData(model) for name, model in models.items()}
    for _ in range(60):
        for name, model in models.items():
            mujoco.mj_step(model, datas[name])
    for name, data in datas.items():
        np.testing.assert_array_equal(data.qpos[-3 * 162 :], ends[name])


_OTHER_PROCESS = """
import pickle, sys
from tests.test_cloth_contact_plugin import run
model, data = pickle.load(sys.stdin.buffer)
sys.stdout.buffer.write(run(model, data).tobytes())
"""


def test_a_pickle_continues_in_another_process():
    model = stack()
    data = started(model)
    code = "from softgym_mj.native.library import load_plugin; load_plugin()\n" + _OTHER_PROCESS
    result = subprocess.run(
        [sys.executable, "-c", code],
        input=pickle.dumps((model, data)),
        capture_output=True,
        check=True,
    )
    assert result.stdout == run(model, data).tobytes()


@pytest.mark.parametrize("threads", [1, 2])
def test_rollouts_agree_with_a_loop(threads):
    model = stack()
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    initial = np.empty((4, size))
    for i, row in enumerate(initial):
        data = started(model, 5 + 5 * i)
        mujoco.mj_getState(model, data, row, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    expected = []
    for row in initial:
        data = mujoco.MjData(model)
        mujoco.mj_setState(model, data, row, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        expected.append(run(model, data)[-1])
    datas = [polluted(model) for _ in range(threads)]
    states, _ = rollout.rollout(model, datas, initial, nstep=STEPS)
    np.testing.assert_array_equal(states[:, -1, 1 : 1 + model.nq], expected)


def test_dm_control_steps_in_its_own_order():
    """mj_step2 then mj_step1: contact acts all the same, and layers stay apart."""
    model = stack()
    physics = dm_mujoco.Physics.from_model(dm_mujoco.wrapper.MjModel(model))
    for _ in range(120):
        physics.step()
    heights = physics.data.flexvert_xpos[:, 2].reshape(2, -1)
    assert np.median(heights[1]) - np.median(heights[0]) == pytest.approx(2 * RADIUS, abs=1e-3)
    assert count_crossings(model, physics.data.ptr) == 0


_DIGEST = """
import numpy as np, sys
from tests.test_cloth_contact_plugin import stack, started, run
model = stack()
sys.stdout.buffer.write(run(model, started(model), 60)[-1].tobytes())
"""


def test_instruction_sets_differ_by_rounding_only():
    ends = []
    for kind in ("scalar", "avx2"):
        result = subprocess.run(
            [sys.executable, "-c", _DIGEST],
            env={**os.environ, "SOFTGYM_MJ_SIMD": kind},
            capture_output=True,
            check=True,
        )
        ends.append(np.frombuffer(result.stdout))
    np.testing.assert_allclose(ends[0], ends[1], atol=2e-3)


# ---------------------------------------------------------------------------- frames and flexes


def test_a_turned_and_moved_parent_changes_nothing():
    """The same two sheets, their parent turned by 90 degrees: the same motion, turned."""
    ends = []
    for parent in ('name="parent"', 'name="parent" pos=".3 -.2 0" euler="0 0 90"'):
        model = model_of(sheet("a", "0 0 .03"), sheet("b", "0 0 .08", "4 0 0"), parent=parent)
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 60)
        mujoco.mj_forward(model, data)
        ends.append(data.flexvert_xpos.copy())
    turned = (ends[1] - [0.3, -0.2, 0]) @ np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(turned, ends[0], atol=1e-3)


def test_a_parent_on_its_side_holds_layers_apart():
    """World z is the parent's x: slides that are not the world's axes."""
    flexes = sheet("a", ".03 0 0", "0 90 0"), sheet("b", ".08 0 0", "0 85 0")
    model = model_of(*flexes, parent='name="parent" euler="0 -90 0"')
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 150)
    assert count_crossings(model, data) == 0
    heights = data.flexvert_xpos[:, 2].reshape(2, -1)
    assert np.median(heights, axis=1) == pytest.approx([RADIUS, 3 * RADIUS], abs=1.5e-3)


def test_cloth_falls_on_cloth_and_cord_on_both():
    model = model_of(
        sheet("a", "0 0 .02"), sheet("b", ".03 0 .05", "0 4 30"), cord("c", "0 0 .1", "0 5 40")
    )
    data = mujoco.MjData(model)
    for _ in range(30):
        mujoco.mj_step(model, data, 5)
        assert count_crossings(model, data) == 0
    heights = data.flexvert_xpos[:, 2]
    a, b, c = heights[:81], heights[81:162], heights[162:]
    assert np.median(a) == pytest.approx(RADIUS, abs=1e-3)
    assert np.median(b) == pytest.approx(3 * RADIUS, abs=1.5e-3)
    # The middle of the cord (radius 4 mm) lies on both; its ends hang down.
    assert np.median(c[5:12]) == pytest.approx(4 * RADIUS + 0.004, abs=2e-3)


def test_a_cord_does_not_fall_through_a_cord():
    model = model_of(cord("a", "0 0 .01"), cord("b", "0 0 .05", "0 0 90"))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 80)
    mujoco.mj_forward(model, data)
    middle = data.flexvert_xpos.reshape(2, 17, 3)[:, 8, 2]
    assert middle[1] - middle[0] == pytest.approx(0.008, abs=1e-3)


PINS = '<pin gridrange="0 0 0 8"/><pin gridrange="8 0 8 8"/>'
TIES = "".join(
    f'<connect body1="a_{9 * x + y}" anchor="0 0 0" solref=".01 1" solimp=".99 .999 .001"/>'
    for x in (0, 8)
    for y in range(9)
)


@pytest.mark.parametrize(("pins", "ties"), [(PINS, ""), ("", TIES)])
def test_what_lies_on_a_hammock_stays_on_it(pins, ties):
    """A sheet held at two sides in the air, by pins or equalities, holds one that falls on it."""
    model = model_of(
        sheet("a", "0 0 .2", inside=pins), sheet("b", "0 0 .3"), floor=False, ties=ties
    )
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 150)
    assert count_crossings(model, data) == 0
    vertices = data.flexvert_xpos.reshape(2, 9, 9, 3)
    np.testing.assert_allclose(vertices[0, [0, 8], :, 2], 0.2, atol=1e-3)
    lower, upper = vertices[:, 2:7, 2:7, 2]
    assert lower.min() > 0.1 and (upper - lower).min() > 1.5 * RADIUS


def test_instances_are_groups_that_do_not_touch():
    xml = """<mujoco><option {}/><extension><plugin plugin="softgym_mj.cloth_contact">
      <instance name="contact"/><instance name="other"/></plugin></extension>
      <worldbody><geom type="plane" size="1 1 .1"/><body name="p">{}{}</body></worldbody>
      </mujoco>"""
    second = sheet("b", "0 0 .05").replace('instance="contact"', 'instance="other"')
    model = mujoco.MjModel.from_xml_string(xml.format(OPTION, sheet("a", "0 0 .02"), second))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 100)
    heights = data.flexvert_xpos[:, 2].reshape(2, -1)
    np.testing.assert_allclose(heights, RADIUS, atol=1e-3)


def test_the_example_of_the_readme_comes_to_rest_in_layers():
    text = (
        pathlib.Path(library.__file__).parents[1] / "fluid" / "plugin" / "README.md"
    ).read_text()
    (xml,) = (block for block in re.findall(r"```xml\n(.*?)```", text, re.S) if "cloth" in block)
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 200)
    assert count_crossings(model, data) == 0
    # The upper sheet covers the middle of the lower one.
    lower, upper = data.flexvert_xpos[:162, 2].reshape(2, 9, 9)[:, 3:6, 3:6]
    np.testing.assert_allclose(lower, RADIUS, atol=1e-3)
    np.testing.assert_allclose(upper, 3 * RADIUS, atol=1.5e-3)
    assert np.linalg.norm(data.qvel.reshape(-1, 3), axis=1).max() < 0.05


# ---------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("iterations", "0", r'iterations="0" is not valid: expected a whole number in 1..1000'),
        ("iterations", "2.5", "whole number"),
        ("iterations", "many", "whole number"),
        ("stretch", "-1", r"stretch=\"-1\" is not valid: expected a number in 0.01..10"),
        ("stretch", "nan", "number in"),
        ("stretch", "0.1 0.2", "number in"),
        ("compression", "1.1", r"number in 0.01..1"),
        ("compression", "1e999", r"number in 0.01..1"),
        ("friction", "-0.1", r"number in 0..10"),
        ("thickness", "1", "unrecognized|invalid|thickness"),
    ],
)
def test_a_bad_attribute_is_a_compile_error(key, value, expected):
    with pytest.raises(ValueError, match=expected):
        model_of(sheet("a"), config=f'<config key="{key}" value="{value}"/>')


def test_fuzzed_attributes_compile_or_say_what_is_wrong():
    random = np.random.default_rng(0)
    alphabet = list("0123456789+-.eE naifx\t")
    outcomes = {True: 0, False: 0}
    for _ in range(150):
        value = "".join(random.choice(alphabet, random.integers(1, 9)))
        key = random.choice(["iterations", "stretch", "compression", "friction"])
        try:
            model = model_of(sheet("a"), config=f'<config key="{key}" value="{value}"/>')
        except ValueError as error:
            assert f"attribute {key}=" in str(error)
            outcomes[False] += 1
        else:
            mujoco.mj_step(model, mujoco.MjData(model))
            outcomes[True] += 1
    assert outcomes[True] > 5 and outcomes[False] > 50


@pytest.mark.parametrize(
    ("flexes", "option", "expected"),
    [
        ([sheet("a").replace('selfcollide="none"', 'selfcollide="auto"')], OPTION, "twice"),
        (
            [sheet("a").replace('contype="0"', 'contype="1"'), sheet("b")],
            OPTION,
            "no bit in common",
        ),
        ([sheet("a").replace('<plugin instance="contact"/>', "")], OPTION, "no flex carries it"),
        ([BLOCK], OPTION, "dimension 1 or 2"),
        ([sheet("a")], 'integrator="RK4"', "RK4 is not supported"),
    ],
)
def test_an_unsuitable_model_is_a_compile_error(flexes, option, expected):
    with pytest.raises(ValueError, match=expected):
        model_of(*flexes, option=option)


def test_not_a_number_is_left_to_mujoco():
    model = stack()
    data = started(model)
    data.qvel[10] = np.nan
    mujoco.mj_step(model, data)
    assert data.warning[mujoco.mjtWarning.mjWARN_BADQVEL].number == 1
    assert np.isfinite(data.qpos).all()
