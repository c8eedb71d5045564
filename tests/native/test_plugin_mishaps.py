"""Tests of the plugins with impossible steps and misplaced particles."""

import subprocess
import sys

import mujoco
import numpy as np
import pytest
from mujoco import rollout

from tests.native.test_state import state_of
from tests.oracles import fluid as reference
from tests.scenes.fluid_cup import SPACING, FluidCup

BAD_QPOS = mujoco.mjtWarning.mjWARN_BADQPOS
NO_RESET = mujoco.mjtDisableBit.mjDSBL_AUTORESET
SLIDE = '<joint type="slide" axis="1 0 0"/>'
CLOTH = '<plugin plugin="softgym_mj.cloth"><instance name="cloth"/></plugin>'
SHEET = """<flexcomp name="{}" type="grid" dim="2" count="9 9 1" spacing=".03 .03 .03" mass=".01"
  radius=".005" pos="{}" euler="{}"><edge damping="1e-12"/>
  <contact selfcollide="none" contype="0" conaffinity="0"/><plugin instance="cloth"/></flexcomp>"""


# ---------------------------------------------------------------------------- not a number


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "discrete", "RK4"])
@pytest.mark.parametrize("bad", [np.nan, -np.inf, 1e12])
def test_bad_particles_restart_the_simulation(bad, integrator):
    """Checks MuJoCo's behavior for divergence: a warning, and the state of a new mjData."""
    option = f'integrator="{integrator}"'
    cup = FluidCup((3, 3), 3, body="", joint=SLIDE, option=option, two_way="true")
    model, data = cup.model, cup.data
    data.qvel[0] = 0.3
    cup.step(20)
    cup.velocities[4, 1] = bad
    cup.step()
    assert data.warning[BAD_QPOS].number == 1
    fresh = mujoco.MjData(model)
    mujoco.mj_forward(model, fresh)
    np.testing.assert_array_equal(state_of(model, data), state_of(model, fresh))
    # From here on it is a simulation like any other.
    mujoco.mj_step(model, data, 30)
    mujoco.mj_step(model, fresh, 30)
    np.testing.assert_array_equal(state_of(model, data), state_of(model, fresh))
    assert data.warning[BAD_QPOS].number == 1


def wet_sheets(count="9 9 1"):
    """Two sheets and a cup of water."""
    sheets = SHEET.format("a", "1 0 .03", "0 0 0") + SHEET.format("b", "1.02 .01 .08", "5 3 20")
    sheets = sheets.replace("9 9 1", count)
    xml = FluidCup((3, 3), 3).xml.replace("</extension>", CLOTH + "</extension>")
    return mujoco.MjModel.from_xml_string(xml.replace("</worldbody>", f"{sheets}</worldbody>"))


def test_cloth_beside_restarting_water_starts_anew_too():
    """It advances in the same step, before or after the water."""
    model = wet_sheets()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 15)
    assert np.abs(data.qpos).max() > 0.01
    data.plugin_state[5] = np.nan
    mujoco.mj_step(model, data)
    assert data.warning[BAD_QPOS].number == 1
    np.testing.assert_allclose(data.qpos, model.qpos0, atol=1e-6)


def stands_still(cup):
    """Checks that two steps warn and move nothing."""
    before = cup.positions.copy()
    cup.step(2)
    np.testing.assert_array_equal(cup.positions, before)
    assert cup.data.warning[BAD_QPOS].number == 2


def test_without_autoreset_bad_particles_stay():
    cup = FluidCup((3, 3), 3)
    cup.model.opt.disableflags |= NO_RESET
    cup.step(5)
    cup.positions[4, 1] = np.nan
    stands_still(cup)
    assert cup.data.time == pytest.approx(0.07)


def test_a_bad_particle_leaves_the_other_rollouts_alone():
    cup = FluidCup((5, 5), 6, body="", joint=SLIDE)
    cup.step(10)
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    states = np.tile(state_of(cup.model, cup.data, kind), (6, 1))
    states[2, -2 * cup.count] = np.nan
    datas = [mujoco.MjData(cup.model) for _ in range(2)]
    ends, _ = rollout.rollout(cup.model, datas, states, nstep=20)
    cup.step(20)
    end = state_of(cup.model, cup.data, kind)
    np.testing.assert_array_equal(ends[[0, 1, 3, 4, 5], -1], np.tile(end, (5, 1)))
    assert np.isfinite(ends).all() and ends[2, -1, 0] == 0.0


@pytest.mark.parametrize("bad", [np.nan, 1e20])
def test_walls_that_are_nowhere_restart_the_simulation(bad):
    """MuJoCo looks at qpos only."""
    cup = FluidCup((3, 3), 3)
    cup.step(5)
    cup.data.mocap_pos[0, 1] = bad
    cup.step()
    assert cup.data.warning[BAD_QPOS].number == 1 and cup.data.time == 0
    cup.step(5)
    assert cup.data.warning[BAD_QPOS].number == 1 and not cup.escaped().any()


_STRANGE_STATE = """
import mujoco, numpy as np
from tests.native.test_plugin_mishaps import two_sheets
model = two_sheets()
rng = np.random.default_rng(0)
for kind in ("any", "pairs"):
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data)
    kept = data.plugin_state[1 + 4 * model.nflexvert + model.nflexedge :]  # From pairs on.
    kept = data.plugin_state[1:] if kind == "any" else kept
    kept[:] = rng.integers(0, 1 << 63, kept.size, dtype=np.uint64).view(float)
    kept[np.isnan(kept)] = 1e300
    mujoco.mj_step(model, data, 2)
    assert data.warning[mujoco.mjtWarning.mjWARN_BADQPOS].number >= (kind == "any")
"""


def test_cloth_stands_any_state():
    """Numbers of pairs in it were indices."""
    subprocess.run([sys.executable, "-c", _STRANGE_STATE], check=True, timeout=120)


# ---------------------------------------------------------------------------- models that changed

FLOOR = '<geom name="floor" type="plane" size="1 1 1" pos="0 0 -1"/>'


def test_when_walls_come_or_go_after_compilation_the_fluid_stands_still():
    cup = FluidCup((3, 3), 3, scenery=FLOOR)
    cup.step(5)
    cup.model.geom("floor").contype[0] = cup.model.geom("floor").conaffinity[0] = 0
    stands_still(cup)
    fresh = mujoco.MjData(cup.model)  # Has its lattice all the same.
    mujoco.mj_resetData(cup.model, cup.data)
    np.testing.assert_array_equal(cup.state, fresh.plugin_state)
    assert np.ptp(cup.positions, axis=0) == pytest.approx([2 * SPACING] * 3, rel=0.01)
    cup.model.geom("floor").contype[0] = 1
    cup.step(20)
    assert not cup.escaped().any() and np.abs(cup.velocities).max() > 0


def two_sheets(option=""):
    sheets = SHEET.format("a", "0 0 .03", "0 0 0") + SHEET.format("b", ".02 .01 .08", "5 3 20")
    return mujoco.MjModel.from_xml_string(
        f"<mujoco><option timestep='0.01'>{option}</option><extension>{CLOTH}</extension>"
        f"<worldbody>{sheets}</worldbody></mujoco>"
    )


def test_without_passive_forces_cloth_is_an_error():
    two_sheets('<flag spring="disable"/>')
    with pytest.raises(ValueError, match="the flags spring and damper disable"):
        two_sheets('<flag spring="disable" damper="disable"/>')


def test_when_cloth_does_not_fit_any_more_it_falls_apart():
    model = two_sheets()
    data = mujoco.MjData(model)
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    mujoco.mj_step(model, data)
    assert data.warning[BAD_QPOS].number == 1
    # All vertices fall freely.
    assert data.qvel[2::3] == pytest.approx(-9.81 * model.opt.timestep, abs=1e-3)


@pytest.mark.parametrize("timestep", [0.0, -0.01, np.nan, 1e9])
def test_with_a_senseless_time_step_water_stands_still(timestep):
    cup = FluidCup((3, 3), 3)
    cup.step(5)
    cup.model.opt.timestep = timestep
    stands_still(cup)


# ---------------------------------------------------------------------------- limits


def test_sizes_beyond_a_limit_are_compile_errors():
    balls = '<geom type="sphere" size=".01"/>' * 400
    with pytest.raises(ValueError, match=r'count="200000" is not valid with 405 geoms.* most 335'):
        FluidCup((2000, 100), 1, scenery=balls)
    with pytest.raises(ValueError, match=r'timestep="1e\+08" is not valid: expected 1e-06..10'):
        FluidCup((3, 3), 3, timestep=1e8)
    cloth = SHEET.format("a", "0 0 0", "0 0 0").replace("9 9 1", "27 27 1")
    body = f'<body name="body"><freejoint/><geom name="ball" size=".05"/>{cloth}</body>'
    with pytest.raises(
        ValueError, match=r'"ball" .* at most 2000 degrees of freedom instead of 2193'
    ):
        mujoco.MjModel.from_xml_string(
            f"<mujoco><extension>{CLOTH}</extension><worldbody>{body}</worldbody></mujoco>"
        )


def test_long_values_leave_room_for_what_is_valid():
    with pytest.raises(ValueError, match=r'friction="é{30}..." is not valid: expected a number in'):
        FluidCup((3, 3), 3, friction="é" * 700)


# ---------------------------------------------------------------------------- one place


def distances(x):
    """Distances of all pairs of particles [spacings]."""
    i, j = np.triu_indices(len(x), 1)
    return np.linalg.norm(x[i] - x[j], axis=1) / SPACING


def test_a_cup_of_water_in_one_place_spreads():
    cup = FluidCup((3, 3), 3, height=1.0)
    cup.positions[:] = [0, 0, SPACING]
    cup.step(200)
    assert distances(cup.positions).min() > 0.6
    assert not cup.escaped().any() and cup.speed() < 0.05


def test_too_many_neighbors_are_counted_as_a_warning():
    """All pairs of these would be half a billion."""
    cup = FluidCup((32, 32), 32, height=2.0, substeps=1)
    cup.positions[:] = [0, 0, SPACING]
    cup.step(2)
    assert cup.data.warning[mujoco.mjtWarning.mjWARN_CONTACTFULL].number == 2
    assert np.isfinite(cup.state).all()
    small = FluidCup((16, 16), 16, height=2.0, substeps=1)  # So few that all pairs have room.
    small.positions[:] = [0, 0, SPACING]
    small.step(5)
    assert small.data.warning[mujoco.mjtWarning.mjWARN_CONTACTFULL].number == 0


@pytest.mark.parametrize("simd", ["avx2", "scalar"])
def test_particles_in_one_place_part_as_in_the_reference(simd, monkeypatch):
    monkeypatch.setenv("SOFTGYM_MJ_SIMD", simd)
    cup = FluidCup((3, 3), 2, substeps="3", body="", joint='<joint axis="0 1 0"/>')
    cup.model.opt.gravity[:] = 0
    cup.positions[:, 2] += 1.0  # No wall is near.
    cup.positions[[4, 9, 17]] = cup.positions[2]
    x, v = cup.positions.copy(), cup.velocities.copy()
    fluid = reference.Fluid(spacing=SPACING, substeps=3)
    for _ in range(2):
        cup.step()
        x, v, _ = reference.step(fluid, 0.01, np.zeros(3), [], x, v)
        np.testing.assert_allclose(cup.positions, x, atol=1e-3 * SPACING)


# ---------------------------------------------------------------------------- far away


@pytest.mark.parametrize("far", [1e5, 1e9])
def test_a_particle_far_away_does_not_disturb_the_rest(far):
    cups = [FluidCup((5, 5), 4, height=0.5) for _ in range(2)]
    for cup in cups:
        cup.step(5)
    cups[1].positions[0] = [far, 0, 0.1]
    for cup in cups:
        cup.step(100)
    assert np.isfinite(cups[1].state).all() and cups[1].data.warning[BAD_QPOS].number == 0
    assert not cups[1].escaped()[1:].any()
    means = [cup.positions[1:].mean(axis=0) for cup in cups]
    np.testing.assert_allclose(means[1], means[0], atol=0.1 * SPACING)
    assert np.abs(cups[1].velocities[1:]).max() < 0.05
