"""Bodies with joints that vertices are tied or pinned to: flexes carry them, and they pull."""

import mujoco
import numpy as np
import pytest

from softgym_mj.cloth import solver
from softgym_mj.native.library import load_plugin
from tests.cloth.flex_scene import GRAVITY

LENGTH, SPACING, CORD_MASS = 0.4, 0.02, 0.02  # [m], [m], [kg]
STRETCH = 500.0  # [N]
HEIGHT = 0.8  # [m] Height of the load's origin.
FIRM = 'solref=".01 1" solimp=".99 .999 .001"'
LAST = 20  # Vertex of a rope.

ENDS = {
    "connect": f'<connect body1="a_{LAST}" body2="load" anchor="0 0 0"/>',
    "the other way round": f'<connect body1="load" body2="a_{LAST}" anchor="0 0 0"/>',
    "weld": f'<weld body1="a_{LAST}" body2="load"/>',
    "pin": "",
}


def model_of(
    body: str, equality: str = "", gravity: float = GRAVITY, extra: str = ""
) -> mujoco.MjModel:
    load_plugin()
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="0.005" gravity="0 0 {-gravity}"/>
        <extension><plugin plugin="softgym_mj.cloth"><instance name="a">
        <config key="stretch" value="{STRETCH}"/><config key="bend" value="1.2e-5"/>
        </instance></plugin></extension>
        <worldbody>{body}</worldbody><equality>{equality}</equality>{extra}</mujoco>"""
    )


def flexcomp(count: str, height: float, pins: str = "", mass: float = CORD_MASS) -> str:
    """A rope or a sheet that hangs from its first vertices, with its middle at `height` [m]."""
    pin = f'<pin id="{pins}"/>' if pins else ""
    return f"""<flexcomp name="a" type="grid" dim="{2 - count.endswith(" 1 1")}" count="{count}"
      spacing="{SPACING} {SPACING} {SPACING}" mass="{mass}" radius=".005" pos="0 0 {height}"
      euler="0 90 0"><contact selfcollide="none" contype="0" conaffinity="0"/>
      <edge damping="1e-12"/>{pin}<plugin plugin="softgym_mj.cloth" instance="a"/></flexcomp>"""


def load(
    inside: str, mass: float, center: str = "0 0 0", shape: str = "size='.01'", damping: float = 0.0
) -> str:
    return f"""<body name="load" pos="0 0 {HEIGHT}"><joint type="free" damping="{damping}"/>
      <geom {shape} mass="{mass}" pos="{center}"/>{inside}</body>"""


def hanging(end: str, mass: float, top: str = "", **settings) -> mujoco.MjModel:
    """A load at the end of a rope that hangs down to `HEIGHT`; `top` holds its first vertex."""
    pins = str(LAST) if end == "pin" else ""
    middle = LENGTH / 2 if pins else HEIGHT + LENGTH / 2
    rope = flexcomp(f"{LAST + 1} 1 1", middle, pins)
    gravity = settings.pop("gravity", GRAVITY)
    body = load(rope, mass, **settings) if pins else load("", mass, **settings) + rope
    return model_of(body, ENDS[end] + top, gravity)


TOP = f'<connect body1="a_0" anchor="0 0 0" {FIRM}/>'


@pytest.mark.parametrize("mass", [0.002, 0.1, 10 * CORD_MASS])
@pytest.mark.parametrize("end", ENDS)
def test_a_load_hangs_where_its_cord_ends(end, mass):
    model = hanging(end, mass, TOP)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 400)
    heights, pulls = [], []
    for _ in range(100):
        mujoco.mj_step(model, data)
        heights.append(data.qpos[2] if end == "pin" else data.body("load").xpos[2])
        pulls.append(solver.holding_force(model, data, LAST))
    # The rope stretches under the load and half of its own weight.
    longer = (mass + CORD_MASS / 2) * GRAVITY * LENGTH / STRETCH
    np.testing.assert_allclose(heights, HEIGHT - longer, atol=2e-4)
    # The vertex of an equality has a weight of its own, a pinned one has none.
    carried = mass + (model.body("a_1").mass[0] if end != "pin" else 0.0)
    assert np.mean(pulls) == pytest.approx(carried * GRAVITY, rel=0.005)


@pytest.mark.parametrize("end", ["connect", "pin"])
def test_a_load_that_hangs_by_its_side_comes_to_rest_below(end):
    model = hanging(end, 0.1, TOP, center=".02 0 -.03", damping=1e-4)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 2000)
    # It still swings a little.
    below = data.body("load").xipos - data.body("load").xpos
    np.testing.assert_allclose(below, [0, 0, -np.hypot(0.02, 0.03)], atol=2e-3)
    assert data.body("load").xpos[2] == pytest.approx(HEIGHT, abs=2e-3)


@pytest.mark.parametrize("end", ["connect", "pin"])
def test_what_flies_free_keeps_its_momentum(end):
    """A box that tumbles, and the rope that it drags along by its side."""
    model = hanging(
        end, 0.1, gravity=0.0, center=".01 0 -.02", shape="type='box' size='.02 .015 .01'"
    )
    data = mujoco.MjData(model)
    data.joint(0).qvel[:] = [0.3, 0.5, -1.0, 2.0, 3.0, 1.0]
    if end == "pin":  # The rope moves with the box, but for its turning.
        data.joint(0).qvel[3:] = 0.0
        for vertex in range(0, LAST, 4):
            data.qvel[model.body(f"a_{vertex}").dofadr[0]] = 0.5
    linear, angular = zip(*(momenta(model, data, steps=8) for _ in range(50)), strict=True)
    for momentum in linear, angular:
        scale = np.linalg.norm(momentum[0])
        np.testing.assert_allclose(momentum, np.tile(momentum[0], (50, 1)), atol=0.03 * scale)


def momenta(
    model: mujoco.MjModel, data: mujoco.MjData, steps: int
) -> tuple[np.ndarray, np.ndarray]:
    """Linear and angular momentum about the origin, after some steps."""
    mujoco.mj_step(model, data, steps)
    mujoco.mj_forward(model, data)
    linear, angular = np.zeros(3), np.zeros(3)
    for body in range(1, model.nbody):
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        axes = data.ximat[body].reshape(3, 3)
        push = model.body_mass[body] * velocity[3:]
        linear += push
        angular += np.cross(data.xipos[body], push)
        angular += axes @ (model.body_inertia[body] * (axes.T @ velocity[:3]))
    return linear, angular


@pytest.mark.parametrize("mass", [0.005, 0.1])
@pytest.mark.parametrize("pinned", [True, False])
def test_a_sheet_carries_a_bar_by_many_vertices(pinned, mass):
    """Its lower rim is tied to the bar, its upper one to the world: it hangs as long as a strip."""
    n, density = 11, 0.33  # [kg/m^2]
    size = (n - 1) * SPACING
    lower = [n * (n - 1) + i for i in range(n)]
    pins = " ".join(map(str, lower)) if pinned else ""
    sheet = flexcomp(f"{n} {n} 1", size / 2 + (0 if pinned else HEIGHT), pins, density * size**2)
    shape = "type='box' size='.005 .1 .005'"
    body = load(sheet, mass, shape=shape) if pinned else load("", mass, shape=shape) + sheet
    ties = [f'<connect body1="a_{i}" anchor="0 0 0" {FIRM}/>' for i in range(n)]
    if not pinned:
        ties += [f'<connect body1="a_{i}" body2="load" anchor="0 0 0"/>' for i in lower]
    model = model_of(body, "".join(ties))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 400)
    longer = (mass + density * size**2 / 2) * GRAVITY / STRETCH
    assert data.body("load").xpos[2] == pytest.approx(HEIGHT - longer, abs=5e-4)
    assert abs(data.body("load").xquat[0]) == pytest.approx(1.0, abs=1e-4)


def test_a_cord_turns_a_wheel_that_is_hung_up_in_its_middle():
    """Its center of mass stays where it is: it turns until the rope hangs below."""
    wheel = """<body name="load" pos="0 0 1"><joint type="hinge" axis="0 1 0" damping="1e-3"/>
      <geom type="cylinder" size=".05 .01" euler="90 0 0" mass=".1"/></body>"""
    rope = flexcomp("11 1 1", 0.9).replace('pos="0 ', 'pos=".05 ')
    model = model_of(wheel + rope, '<connect body1="a_0" body2="load" anchor="0 0 0"/>')
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 2000)
    assert data.qpos[0] == pytest.approx(np.pi / 2, abs=0.05)


def test_a_load_falls_when_its_equality_lets_go():
    model = hanging("connect", 0.1, TOP, shape="size='.01' contype='0' conaffinity='0'")
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 100)
    height = data.body("load").xpos[2]
    data.eq_active[0] = 0
    mujoco.mj_step(model, data, 40)
    fallen = height - data.body("load").xpos[2]
    assert fallen == pytest.approx(GRAVITY * 0.2**2 / 2, rel=0.04)


@pytest.mark.parametrize("joints", [3, 1], ids=["three slides", "a rail"])
def test_a_vertex_may_be_a_load_on_slides(joints):
    """A flex with explicit bodies: ten vertices and a load of 2 kg."""
    axes = ("0 0 1", "1 0 0", "0 1 0")
    slides = [f'<joint type="slide" axis="{axis}" damping="{{}}"/>' for axis in axes]
    bodies = "".join(
        f"""<body name="a_{i}" pos="0 0 {1 - 0.02 * i}">{"".join(slides).format(0, 0, 0)}
        <inertial mass="1e-3" pos="0 0 0" diaginertia="1e-6 1e-6 1e-6"/>
        <plugin plugin="softgym_mj.cloth" instance="a"/></body>"""
        for i in range(10)
    )
    last = "".join(slides[:joints]).format(20, 20, 20)
    names = [f"a_{i}" for i in range(10)] + ["load"]
    elements = " ".join(f"{i} {i + 1}" for i in range(10))
    model = model_of(
        f'{bodies}<body name="load" pos="0 0 .8">{last}<geom size=".01" mass="2"/></body>',
        TOP,
        extra=f"""<deformable><flex name="a" dim="1" radius=".005" body="{" ".join(names)}"
        element="{elements}"><contact selfcollide="none" contype="0" conaffinity="0"/>
        <edge damping="1e-12"/></flex></deformable>""",
    )
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 600)
    longer = 2 * GRAVITY * 0.2 / STRETCH
    assert data.body("load").xpos[2] == pytest.approx(HEIGHT - longer, abs=2e-4)
