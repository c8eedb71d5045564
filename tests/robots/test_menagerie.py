"""Arms with the looks of MuJoCo Menagerie, here those of small models that have its names."""

import sys

import mujoco
import numpy as np
import pytest

import softgym_mj
from softgym_mj.exceptions import InvalidArgumentError, UnavailableError
from softgym_mj.policies.experts import make_policy
from softgym_mj.robots.arm.models import ARMS
from tests.robots.arms import arms_of
from tests.robots.test_arm_models import AXES, FRAMES

FINGERS = """
  <body name="left_finger" pos="0 0 0.0584">
    <joint name="finger_joint1" class="finger"/> {shapes}
  </body>
  <body name="right_finger" pos="0 0 0.0584" quat="0 0 0 1">
    <joint name="finger_joint2" class="finger"/> {shapes}
  </body>"""
# Different lengths along all axes, far from its origin.
VERTICES = np.array([[0.1, 0.2, 0.3], [0.2, 0.2, 0.3], [0.1, 0.25, 0.3], [0.1, 0.2, 0.33]])
OBJ = "".join(f"v {x} {y} {z}\n" for x, y, z in VERTICES) + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
SCALE = np.array([0.5, 1.0, -2.0])
POSITION, QUATERNION = np.array([0.01, -0.02, 0.03]), np.array([0.5, 0.5, -0.5, 0.5])
PAINT, SKY = [0.9, 0.1, 0.2, 1.0], [0.1, 0.5, 0.8, 1.0]
SHAPES = """
  <geom class="visual" mesh="wedge" material="paint" pos="0.01 -0.02 0.03" quat="1 1 -1 1"/>
  <geom class="visual" mesh="stretched" rgba="0.1 0.5 0.8 1"/>
  <geom class="visual" type="box" size="0.01 0.02 0.03" material="paint"/>
  <geom class="visual" type="sphere" size="0.3" group="4"/>
  <geom class="collision" size="0.05"/>"""
MODEL = """<mujoco>
  <compiler angle="radian" meshdir="assets" autolimits="true"/>
  <default>
    <default class="robot">
      <material specular="0.4" shininess="0.2"/>
      <joint axis="0 0 1"/>
      <default class="finger"><joint axis="0 1 0" type="slide" range="0 0.04"/></default>
      <default class="visual"><geom type="mesh" contype="0" conaffinity="0" group="2"/></default>
      <default class="collision"><geom group="3"/></default>
    </default>
  </default>
  <asset>
    <material class="robot" name="paint" rgba="0.9 0.1 0.2 1"/>
    <mesh file="wedge.obj"/>
    <mesh name="stretched" file="wedge.obj" scale="0.5 1 -2"/>
  </asset>
  <worldbody>{bodies}</worldbody>
</mujoco>"""
FOLDERS = {
    "franka": ("franka_emika_panda", "panda.xml", FINGERS.format(shapes=SHAPES)),
    "sawyer": ("rethink_robotics_sawyer", "sawyer.xml", ""),
    "ur5e": ("universal_robots_ur5e", "ur5e.xml", ""),
}
LACKING = {"franka": {"tcp"}, "sawyer": {"head", "right_hand", "tcp"}, "ur5e": {"hand", "tcp"}}


def links(arm):
    """Returns the links that Menagerie has: its Sawyer lacks head and gripper."""
    return [name for name in FRAMES[arm] if name not in LACKING[arm]]


def numbers(values):
    return " ".join(map(str, values))


@pytest.fixture(autouse=True)
def root(tmp_path, monkeypatch):
    """A folder like a checkout of Menagerie."""
    for arm, (folder, file, fingers) in FOLDERS.items():
        assets = tmp_path / folder / "assets"
        assets.mkdir(parents=True)
        (assets / "wedge.obj").write_text(OBJ)
        bodies, axes = fingers, dict(zip(ARMS[arm].joints, AXES[arm], strict=True))
        for name in reversed(links(arm)):
            _, position, quaternion, joint = FRAMES[arm][name]
            start = f'<body name="{name}" pos="{numbers(position)}" quat="{numbers(quaternion)}">'
            hinge = ""
            if joint is not None:
                axis = numbers(int(letter == axes[joint]) for letter in "xyz")
                hinge = f'<joint name="{joint}" axis="{axis}"/>'
            bodies = f"{start}{hinge}{SHAPES}{bodies}</body>\n"
        bodies = bodies.replace("<body ", '<body childclass="robot" ', 1)
        (tmp_path / folder / file).write_text(MODEL.format(bodies=bodies))
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path))
    return tmp_path


def make(arm="franka", **settings):
    return softgym_mj.load(
        "fold_cloth",
        actor=arm,
        split="all",
        **{"fidelity": "fast", "visual": "menagerie"} | settings,
    )


def shown(model, body):
    """The shapes of a body that are drawn."""
    owned = model.geom_bodyid == model.body(body).id
    return np.flatnonzero(owned & (model.geom_group < 3))


def placed_vertices(model, geom):
    """Vertices (4, 3) [m] of a mesh in the frame of its body, in the order of the file."""
    mesh = model.mesh(model.geom_dataid[geom])
    first, number = mesh.vertadr[0], mesh.vertnum[0]
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    return model.mesh_vert[first : first + number] @ turn.reshape(3, 3).T + model.geom_pos[geom]


@pytest.mark.parametrize("arm", ARMS)
def test_links_are_drawn_as_in_menagerie(arm):
    env = make(arm)
    model = env.physics.model.ptr
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, QUATERNION)
    fingers = ["left_finger", "right_finger"] if arm == "franka" else []
    for i in (0, 1):
        for body in links(arm) + fingers:
            wedge, stretched, box = shown(model, f"arms/{arm}_{i}/{body}")
            expected = VERTICES @ turn.reshape(3, 3).T + POSITION
            np.testing.assert_allclose(placed_vertices(model, wedge), expected, atol=1e-6)
            np.testing.assert_allclose(
                placed_vertices(model, stretched), VERTICES * SCALE, atol=1e-6
            )
            np.testing.assert_allclose(model.geom_rgba[stretched], SKY)
            assert model.geom_matid[stretched] == -1
            assert model.geom_type[box] == mujoco.mjtGeom.mjGEOM_BOX
            np.testing.assert_allclose(model.geom_size[box], [0.01, 0.02, 0.03])
            for geom in (wedge, box):
                material = model.mat(model.geom_matid[geom])
                np.testing.assert_allclose(material.rgba, PAINT)
                np.testing.assert_allclose(
                    [material.specular[0], material.shininess[0]], [0.4, 0.2]
                )
            for geom in (wedge, stretched, box):
                assert model.geom_contype[geom] == model.geom_conaffinity[geom] == 0


def test_a_model_that_is_rounded_to_millimeters_is_the_same_arm(root):
    """Menagerie's UR5e; its base is turned, too."""
    for ours, theirs in (("0 0 0.1625", "0 0 0.163"), ("0 0 0.3922", "0 0 0.392"),
                         ("0 0.1263 0", "0 0.127 0"), ("0 0 0.0997", "0 0 0.1")):  # fmt: skip
        edit(root, "ur5e", f'pos="{ours}"', f'pos="{theirs}"')
    edit(root, "ur5e", 'name="base" pos="0 0 0" quat="1 0 0 0"', 'name="base" quat="1 0 0 1"')
    env = make("ur5e")
    model = env.physics.model.ptr
    assert len(shown(model, "arms/ur5e_0/wrist_3_link")) == 3


def test_what_menagerie_lacks_keeps_our_looks():
    envs = [make("sawyer", visual=visual) for visual in ("primitive", "menagerie")]
    ours, dressed = (env.physics.model.ptr for env in envs)
    for body in ("head", "gripper_base", "left_finger", "right_finger"):
        before, after = (shown(model, f"arms/sawyer_0/{body}") for model in (ours, dressed))
        assert len(before) == len(after) > 0
        np.testing.assert_array_equal(ours.geom_type[before], dressed.geom_type[after])
        np.testing.assert_array_equal(ours.geom_pos[before], dressed.geom_pos[after])


@arms_of("franka")
def test_nothing_but_looks_changes(arm):
    """A fold up to when the cloth is carried, and all that dynamics depends on."""
    paths, models = [], []
    for visual in ("primitive", "menagerie"):
        env = make(arm, visual=visual)
        timestep = env.reset(806)
        act = make_policy(env)
        path = []
        for _ in range(25):
            timestep = env.step(act(timestep))
            path.append(env.physics.data.qpos.copy())
        assert np.all(env.task.actor.held >= 0)
        paths.append(np.array(path))
        models.append(env.physics.model.ptr)
    np.testing.assert_array_equal(*paths)
    for field in ("body_mass", "body_inertia", "body_ipos", "body_pos", "jnt_range", "dof_armature",
                  "actuator_gainprm", "actuator_forcerange", "site_pos"):  # fmt: skip
        np.testing.assert_array_equal(*(getattr(model, field) for model in models))
    solid = [model.geom_group >= 3 for model in models]
    for field in ("geom_type", "geom_size", "geom_pos", "geom_quat", "geom_conaffinity"):
        values = (getattr(model, field)[which] for model, which in zip(models, solid, strict=True))
        np.testing.assert_array_equal(*values)


def edit(root, arm, old, new):
    folder, file, *_ = FOLDERS[arm]
    text = (root / folder / file).read_text()
    assert old in text
    (root / folder / file).write_text(text.replace(old, new))


@pytest.mark.parametrize(
    ("arm", "old", "new", "reason"),
    [
        ("franka", 'pos="0 -0.316 0"', 'pos="0 -0.318 0"', "'link3' is 2.0 mm and 0.0000 rad from"),
        ("franka", '<joint axis="0 1 0"', '<joint axis="0 -1 0"', "joint 'finger_joint1' is"),
        (
            "sawyer",
            '0.08" quat="1 0 0 0"',
            '0.08" quat="0 0 0 1"',
            "'right_l0' is 0.0 mm and 3.1416",
        ),
        ("sawyer", '"right_j3"', '"elbow"', "no body 'right_l3' with a joint 'right_j3'"),
        ("sawyer", '"right_l3"', '"elbow"', "no body 'right_l3' with a joint 'right_j3'"),
        ("sawyer", "</mujoco>", "", "XML"),
        ("sawyer", 'meshdir="assets"', 'meshdir="parts"', "wedge.obj"),
    ],
)
def test_another_model_is_refused(root, arm, old, new, reason):
    edit(root, arm, old, new)
    with pytest.raises(UnavailableError, match=reason) as error:
        make(arm)
    assert arm in str(error.value) and "MENAGERIE_ROOT" in str(error.value)


def test_frames_may_differ_by_rounding(root):
    edit(root, "franka", 'pos="0 -0.316 0"', 'pos="0 -0.3165 0"')
    make()


def test_a_checkout_without_the_arm_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path / "assets"))
    with pytest.raises(UnavailableError, match="'franka_emika_panda' not found under MENAG"):
        make()


def test_a_failed_download_says_what_to_do(tmp_path, monkeypatch):
    monkeypatch.delenv("MENAGERIE_ROOT")
    monkeypatch.setenv("MENAGERIE_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("MENAGERIE_BASE_URL", (tmp_path / "nowhere").as_uri())
    with pytest.raises(UnavailableError, match=r"nowhere.* MENAGERIE_ROOT .*clone"):
        make()


def test_a_missing_package_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", None)  # Cannot be imported.
    with pytest.raises(UnavailableError, match=r"pip install '\.\[menagerie\]'"):
        make()


def test_other_looks_are_refused():
    with pytest.raises(InvalidArgumentError, match=r"visual='chrome'.*'primitive', 'menagerie'"):
        make(visual="chrome")
    with pytest.raises(InvalidArgumentError, match=r"visual='menagerie'.*None with actor='picker'"):
        make("picker")
