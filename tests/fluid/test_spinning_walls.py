"""A closed box of water that is spun and shaken: it is tight as fast as its corners may move."""

import mujoco
import numpy as np
import pytest

from softgym_mj.fluid import load_plugin

HALF, WALL, DT, COUNT = 0.1, 0.005, 0.01, 500
SUBSTEPS, SPACING = 8, 0.018
FASTEST = 10.0  # [m/s] max_speed; 8 substeps allow 13.
OUTSIDE = HALF + 2 * WALL
CORNERS = OUTSIDE * np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T
WARNING = mujoco.mjtWarning.mjWARN_BADQVEL


def _box():
    load_plugin()
    walls = ""
    for axis in range(3):
        for sign in (-1, 1):
            place, size = np.zeros(3), np.full(3, OUTSIDE)
            place[axis], size[axis] = sign * (HALF + WALL), WALL
            place, size = (" ".join(map(str, values)) for values in (place, size))
            walls += f'<geom type="box" pos="{place}" size="{size}"/>'
    first = -3.5 * SPACING
    return mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <option timestep="{DT}"/>
  <extension><plugin plugin="softgym_mj.fluid"><instance name="water">
    <config key="count" value="{COUNT}"/> <config key="columns" value="8 8"/>
    <config key="corner" value="{first} {first} -0.08"/>
    <config key="substeps" value="{SUBSTEPS}"/>
  </instance></plugin></extension>
  <worldbody><body name="box" mocap="true">{walls}<plugin instance="water"/></body></worldbody>
</mujoco>""")


def _play(spin, shake, axis):
    """Returns the number of particles outside, the fastest corner [m/s] and the warnings."""
    model = _box()
    data = mujoco.MjData(model)
    axis, rate = np.array(axis) / np.linalg.norm(axis), 4 * np.pi
    angle, fastest, before = 0.0, 0.0, CORNERS
    for step in range(1, 101):
        share = min(1.0, step / 40)
        angle += share * spin * DT
        data.mocap_quat[0, 0] = np.cos(angle / 2)
        data.mocap_quat[0, 1:] = np.sin(angle / 2) * axis
        data.mocap_pos[0, 0] = share * shake / rate * np.sin(rate * step * DT)
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, data.mocap_quat[0])
        rotation = rotation.reshape(3, 3)
        corners = CORNERS @ rotation.T + data.mocap_pos[0]
        fastest = max(fastest, np.linalg.norm(corners - before, axis=1).max() / DT)
        before = corners
        mujoco.mj_step(model, data)
    points = data.plugin_state[1 : 1 + 3 * COUNT].reshape(-1, 3) - data.mocap_pos[0]
    outside = (np.abs(points @ rotation) > HALF + WALL).any(axis=1).sum()
    return outside, fastest, data.warning[WARNING].number


@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 2, 3)])
@pytest.mark.parametrize(
    ("spin", "shake"), [(0, 6), (10, 6), (20, 3.8), (30, 4), (40, 3), (50, 0), (50, 1), (60, 0)]
)
def test_a_box_is_tight_up_to_the_largest_speed(spin, shake, axis):
    outside, fastest, warnings = _play(spin, shake, axis)
    if fastest < 0.98 * FASTEST:
        assert (outside, warnings) == (0, 0)
    else:
        assert warnings


@pytest.mark.parametrize(("spin", "shake"), [(70, 0), (80, 2), (50, 5)])
def test_faster_walls_count_as_teleported_with_a_warning(spin, shake):
    outside, fastest, warnings = _play(spin, shake, (0, 0, 1))
    assert fastest > FASTEST
    assert outside and warnings


# Axis of a turn, and how far from it the fastest point is [m]: 0 where a turn changes no shape.
WAYS = {
    'type="sphere" size="0.3"': ((0, 0, 1), 0.0),
    'type="capsule" size="0.02 0.3"': ((0, 0, 1), 0.0),
    'type="cylinder" size="0.2 0.3"': ((0, 0, 1), 0.0),
    'type="box" size="0.1 0.2 0.3"': ((0, 0, 1), np.hypot(0.1, 0.2)),
    'type="capsule" size="0.02 0.25"': ((1, 0, 0), 0.25),
    'type="cylinder" size="0.001 0.25"': ((0, 1, 0), 0.251),
    'type="box" size="0.3 0.1 0.2"': ((1, 0, 0), np.hypot(0.1, 0.2)),
    'type="ellipsoid" size="0.1 0.2 0.3"': ((1, 0, 0), 0.3),
}


@pytest.mark.parametrize("geom", WAYS)
def test_the_fastest_point_decides(geom):
    """The reach of a step is 0.1 m: of a point at a distance r from the axis, a turn by 0.1 / r."""
    load_plugin()
    axis, distance = WAYS[geom]
    model = mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <option timestep="0.01"/>
  <extension><plugin plugin="softgym_mj.fluid"><instance name="water">
    <config key="count" value="1"/> <config key="substeps" value="8"/>
    <config key="corner" value="5 5 5"/>
  </instance></plugin></extension>
  <worldbody><body mocap="true"><geom {geom}/><plugin instance="water"/></body></worldbody>
</mujoco>""")
    for share, warns in ((0.99, False), (1.01, True)):
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data)
        angle = share * 0.1 / distance if distance else 3.0
        mujoco.mju_axisAngle2Quat(data.mocap_quat[0], np.array(axis, float), angle)
        mujoco.mj_step(model, data)
        assert bool(data.warning[WARNING].number) == (warns and distance > 0)
