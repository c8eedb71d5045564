"""When OpenGL is loaded: with the first image, and after triton."""

import os
import shutil
import subprocess
import sys

import numpy
import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc/self/maps")

LIBRARIES = """
import re
def opened():
    return sorted(set(re.findall(
        "libE?GL|libLLVM|swrast|gallium|libOSMesa|libtriton", open("/proc/self/maps").read()
    )))
"""
STATES = """
import gymnasium, numpy as np, softgym_mj
for task in ("fold_cloth", "transport_water"):
    env = softgym_mj.load(task, fidelity="fast")
    env.reset()
    env.step(np.zeros(env.action_spec().shape))
    for env in (
        gymnasium.make(softgym_mj.TASKS[task].gymnasium_id, fidelity="fast"),
        softgym_mj.make_vec(task, 1, device="host", fidelity="fast"),
    ):
        env.reset(seed=0)
        env.step(env.action_space.sample())
        env.close()
print(opened())
"""
IMAGE = """
import softgym_mj
env = softgym_mj.load("straighten_rope", fidelity="fast", observation="rgb", image_size=(16, 16))
print(opened())
print(env.reset().observation["rgb"].std() > 0)
print(opened())
"""


def run(code, **environment):
    variables = os.environ | {"MUJOCO_GL": "egl"} | environment
    variables = {name: value for name, value in variables.items() if value is not None}
    done = subprocess.run(
        [sys.executable, "-c", LIBRARIES + code],
        check=False, capture_output=True, text=True, env=variables,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_environments_of_states_open_no_opengl():
    assert run(STATES) == ["[]"]


def test_an_image_opens_it_after_the_library_of_triton(tmp_path):
    folder = tmp_path / "triton" / "_C"
    folder.mkdir(parents=True)
    (folder.parent / "__init__.py").write_text("raise RuntimeError('it is not imported')")
    shutil.copy(numpy._core._multiarray_umath.__file__, folder / "libtriton.so")  # Any library.
    path = os.pathsep.join((str(tmp_path), os.environ.get("PYTHONPATH", "")))
    before, drawn, after = run(IMAGE, PYTHONPATH=path)
    assert (before, drawn) == ("[]", "True")
    assert "libEGL" in after and "libtriton" in after


@pytest.mark.parametrize("renderer", ["mujoco", "context", "dm_control"])
def test_other_renderers_go_on(renderer):
    code = {
        "mujoco": """
import softgym_mj, mujoco
model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><light/><geom size='1' rgba='1 0 0 1'/></worldbody></mujoco>"
)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 16, 16) as view:
    view.update_scene(data)
    print(view.render().std() > 0)
""",
        "context": """
import softgym_mj, mujoco
context = mujoco.GLContext(16, 16)
context.make_current()
from OpenGL import GL
print(len(GL.glGetString(GL.GL_VERSION)) > 0)
""",
        "dm_control": """
import softgym_mj
from dm_control import suite
env = suite.load("cartpole", "balance")
env.reset()
print(env.physics.render(16, 16).std() > 0)
""",
    }[renderer]
    assert run(code) == ["True"]


@pytest.mark.skipif(os.uname().machine != "x86_64", reason="no triton")
def test_pyopengl_may_be_imported_before_the_first_image_and_triton_after_it():
    # PyOpenGL chooses a platform when it is imported, as by dm_control's viewer.
    code = f"import softgym_mj\nimport OpenGL.GL\n{IMAGE}\nimport triton\nprint(triton.__name__)"
    assert run(code)[1::2] == ["True", "triton"]


def test_images_after_an_import_of_dm_control_that_opened_opengl():
    before, drawn, _ = run(f"from dm_control import suite\n{IMAGE}")
    assert "libEGL" in before and drawn == "True"


@pytest.mark.parametrize(
    "first", ["from dm_control import suite", pytest.param("import mujoco", marks=pytest.mark.long)]
)
def test_packages_imported_earlier_without_a_display_render_off_screen(first):
    # Without MUJOCO_GL, both have chosen GLFW by then.
    code = f"""
{first}
{IMAGE}
from dm_control import suite
env = suite.load("cartpole", "balance")
env.reset()
print(env.physics.render(16, 16).std() > 0)
import mujoco
model = mujoco.MjModel.from_xml_string("<mujoco/>")
print(mujoco.Renderer(model, 16, 16).render().shape)
"""
    lines = run(code, MUJOCO_GL=None, DISPLAY=None, WAYLAND_DISPLAY=None)
    assert lines[1] == lines[3] == "True"
    assert lines[4] == "(16, 16, 3)"
