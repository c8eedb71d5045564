"""Hands of arms in batches that touch fixed solids, against MuJoCo."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from softgym_mj.robots.arm import bodies
from softgym_mj.robots.arm.models import ARMS
from softgym_mj.robots.arm_batch import chain, clearance, contacts, dynamics, models
from tests.robots.arms import usually

ARM = ARMS["franka"]
STEPS = 40
# Solid below the hand or beside it: type, half sizes [m], quaternion, position relative to the
# parts of the hand that touch it [m], and the end of their names.
SOLIDS = {
    "bar": (
        "capsule", (0.012, 0.3, 0.0), (0.7071, 0.7071, 0.0, 0.0), (0.0, 0.0, -0.06), "collision",
    ),
    "post": ("cylinder", (0.015, 0.4, 0.0), (1.0, 0.0, 0.0, 0.0), (0.06, 0.02, 0.0), "collision"),
    "block": ("box", (0.1, 0.15, 0.03), (0.99, 0.0, 0.0, 0.14), (0.0, 0.0, -0.08), "collision"),
    "pads on bar": (
        "capsule", (0.012, 0.3, 0.0), (0.7071, 0.7071, 0.02, 0.0), (0.001, 0.0, -0.04), "pad",
    ),
    "pads on cap": (
        "cylinder", (0.07, 0.01, 0.0), (1.0, 0.0, 0.002, 0.1), (0.001, 0.0, -0.04), "pad",
    ),
    "jaw": ("box", (0.01, 0.002, 0.0125), (0.97, 0.0, 0.0, 0.24), (0.0, 0.04, -0.03), "pad"),
}  # fmt: skip
# Motion of the hand's command in a step [m].
MOTIONS = {"bar": (0.0005, 0.0, -0.002), "post": (0.002, 0.0, 0.0)}
DOWN = 0.0005, 0.0005, -0.002


def _scene(kind, middle):
    """Models of an arm whose hand touches a solid next to `middle`, and of the arm alone."""
    shape, size, quaternion, away, _ = SOLIDS[kind]
    root = models._root(ARM)
    root.option.set_attributes(integrator="discrete", timestep=0.01, gravity=[0.0, 0.0, 0.0])
    root.worldbody.add(
        "geom", name="solid", type=shape, size=size, pos=middle + away, quat=quaternion,
        contype=1, conaffinity=3,
        friction=[0.4, 0.005, 0.0001], priority=1, solref=[0.01, 1.0],
    )  # fmt: skip
    model = mujoco.MjModel.from_xml_string(root.to_xml_string(), assets=root.get_assets())
    alone, _ = models.dynamic_model(ARM, 0.01)
    for name in ("biasprm", "forcerange"):  # Servos as tuned for scenes.
        own = getattr(model, f"actuator_{name}")
        for i in range(alone.nu):
            own[model.actuator(alone.actuator(i).name).id] = getattr(alone, f"actuator_{name}")[i]
    return model, alone


@pytest.mark.usefixtures("double_precision")
@usually("kind", [*SOLIDS], "bar", "jaw")
def test_a_hand_is_stopped_by_a_solid_as_in_mujoco(kind):
    geometry, geoms = models.solid_model(ARM, "attach")
    home = [*bodies.home(ARM), *(2 * [ARM.finger_range[1]])]
    data = mujoco.MjData(geometry)
    data.qpos[:] = home
    mujoco.mj_kinematics(geometry, data)
    touches = np.array([geometry.geom(i).name.endswith(SOLIDS[kind][-1]) for i in geoms])
    model, alone = _scene(kind, data.geom_xpos[geoms][touches].mean(0))
    arm, joints = dynamics.dynamics_of(alone), len(ARM.joints)
    names = [geometry.geom(i).name for i in geoms]
    hand = [model.geom(name).id for name in names]
    model.geom_contype[np.array(hand)[~touches]] = 0
    data, solid = mujoco.MjData(model), model.geom("solid").id
    data.qpos[:] = home
    mujoco.mj_forward(model, data)
    fixed = contacts.read_fixed(model, data, hand, [solid])
    fixed = {kind: contacts.Fixed(**row) for kind, row in fixed.items()}
    shapes = clearance.shapes_of(geometry, geoms)

    @jax.jit
    def step(angles, speeds, commands):
        pose, mount = chain.poses(arm.chain, angles), (jnp.zeros(3), jnp.eye(3))
        met = contacts.contacts(arm.chain, shapes, fixed, pose, mount, touches)
        return dynamics.step(arm, pose, angles, speeds, commands, contacts=met)[:2]

    motors = np.argsort(model.actuator_trnid[:, 0])
    command, jacobian, number = data.qpos.copy(), np.zeros((3, model.nv)), 0
    angles, speeds = data.qpos.copy(), data.qvel.copy()
    mujoco.mj_jacBody(model, data, jacobian, None, model.geom_bodyid[hand[0]])
    for k in range(STEPS):
        if k < STEPS / 2:
            command[:joints] += np.linalg.pinv(jacobian[:, :joints]) @ MOTIONS.get(kind, DOWN)
        data.ctrl[motors] = command
        mujoco.mj_step(model, data)
        angles, speeds = step(angles, speeds, command)
        number += data.ncon > 0
        np.testing.assert_allclose(angles, data.qpos, atol=1e-6)
    assert number > 5
    # Without the solid, the hand follows the command.
    assert np.abs(data.qpos - command)[:joints].max() > 0.014
