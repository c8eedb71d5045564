"""The page on plain MuJoCo: its script runs, and the models are what the page says."""

import pathlib
import re
import subprocess
import sys
import types

import mujoco
import numpy as np
import pytest

import softgym_mj
from softgym_mj.fluid import load_plugin
from softgym_mj.native.caches import CACHE_VARIABLE

PAGE = (pathlib.Path(__file__).parents[2] / "docs" / "plain_mujoco.md").read_text()
*SCRIPT, OTHER_PROCESS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
STEPS = 20  # Steps of the code block for another process.
STATE = mujoco.mjtState.mjSTATE_INTEGRATION


@pytest.fixture(name="folder", scope="module")
def _folder(tmp_path_factory):
    """Folder in which the script runs."""
    return tmp_path_factory.mktemp("plain")


@pytest.fixture(name="blocks", scope="module")
def _blocks(folder):
    """The script's variables after each of its blocks, with an empty cache of start states."""
    variables, after = {}, []
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(CACHE_VARIABLE, str(folder / "cache"))
        patch.chdir(folder)
        for code in SCRIPT:
            exec(compile(code, "plain_mujoco.md", "exec"), variables)
            after.append(types.SimpleNamespace(**variables))
            after[-1].qpos = variables["data"].qpos.copy()
    return after


def played(model, state, steps=STEPS):
    """Positions after some steps from a state."""
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, state, STATE)
    mujoco.mj_step(model, data, steps)
    return data.qpos


def test_the_copy_goes_on_as_the_environment_does(blocks):
    env = softgym_mj.load("fold_cloth", actor="franka", split="evaluate")
    env.reset(803)
    env.physics.step()
    np.testing.assert_array_equal(blocks[0].qpos, env.physics.data.qpos)


def test_arms_go_where_joints_and_torques_lead_them(blocks):
    servos, torques = blocks[1:3]
    moved = servos.qpos[servos.angles] - servos.start
    np.testing.assert_allclose(moved, [0.3, -0.2, 0.0, 0.3, 0.0, 0.0, 0.5], atol=1e-3)
    np.testing.assert_allclose(torques.qpos[torques.angles], torques.start, atol=1e-3)
    # The other arm has stood still.
    others = [torques.model.joint(f"arms/franka_1/joint{i}").qposadr[0] for i in range(1, 8)]
    np.testing.assert_allclose(torques.qpos[others], blocks[0].qpos[others], atol=2e-3)


def test_files_have_the_model_that_the_page_says(blocks, folder):
    load_plugin()
    model, state = blocks[3].model, blocks[3].state
    exact = played(model, state)
    binary = mujoco.MjModel.from_binary_path(str(folder / "model" / "fold_cloth.mjb"))
    np.testing.assert_array_equal(played(binary, state), exact)
    exported = mujoco.MjModel.from_xml_path(str(folder / "model" / "fold_cloth.xml"))
    fitted = ("actuator_biasprm", "actuator_forcerange", "flex_edgedamping")
    for name in dir(model):
        value = getattr(model, name)
        # Attributes of file names and goal marks.
        if name == "_sizes" or name.endswith("pathadr") or name.startswith("site_"):
            continue
        if isinstance(value, np.ndarray):
            same = np.array_equal(value, getattr(exported, name))
            assert same != (name in fitted), name
    for name in fitted:
        getattr(exported, name)[:] = getattr(model, name)
    np.testing.assert_array_equal(played(exported, state), exact)
    last = mujoco.MjModel.from_xml_path(str(folder / "model" / "last.xml"))
    for name in (*fitted, "actuator_gainprm", "body_pos", "flex_radius"):
        np.testing.assert_allclose(getattr(last, name), getattr(model, name), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(played(last, state), exact, atol=1e-4)


def in_another_process(code, folder):
    return subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )


def test_another_process_goes_on_from_files(blocks, folder):
    code = f"{OTHER_PROCESS}np.save('qpos.npy', data.qpos)"
    done = in_another_process(code, folder)
    assert done.returncode == 0, done.stderr
    expected = played(blocks[3].model, blocks[3].state)
    np.testing.assert_array_equal(np.load(folder / "qpos.npy"), expected)


@pytest.mark.usefixtures("blocks")
def test_without_plugins_xml_says_so_and_binary_models_crash(folder):
    step = "import mujoco; model = mujoco.MjModel.{}; mujoco.mj_step(model, mujoco.MjData(model))"
    xml = in_another_process(step.format("from_xml_path('model/fold_cloth.xml')"), folder)
    assert xml.returncode == 1 and "plugin softgym_mj.cloth not found" in xml.stderr
    binary = in_another_process(step.format("from_binary_path('model/fold_cloth.mjb')"), folder)
    # Not an exception, which would be 1: the warning of the page is needed.
    assert binary.returncode not in (0, 1)
