"""The native library: loading it, what goes wrong, installing it."""

import os
import pathlib
import shutil
import subprocess
import sys
import sysconfig
import textwrap
import zipfile

import mujoco
import pytest

from softgym_mj.exceptions import UnavailableError
from softgym_mj.native import library

ROOT = pathlib.Path(__file__).parents[2]
README = ROOT / "softgym_mj" / "fluid" / "plugin" / "README.md"


@pytest.fixture
def unloaded(monkeypatch):
    """Simulates a process that has not loaded the library."""
    monkeypatch.setattr(library, "_is_registered", lambda: False)


def test_loading_twice_is_loading_once():
    first = library.load_plugin()
    assert library.load_plugin() == first
    assert mujoco.__version__ in first.name


def test_another_mujoco_is_named_at_once(tmp_path):
    """By its metadata: what dm_control makes of it would come first."""
    metadata = tmp_path / "mujoco-4.0.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: mujoco\nVersion: 4.0.0\n")
    path = os.pathsep.join([str(tmp_path), *sys.path])
    process = subprocess.run(
        [sys.executable, "-c", "import softgym_mj"],
        env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    last = process.stderr.strip().splitlines()[-1]
    assert f"pip install mujoco=={mujoco.__version__}" in last and "4.0.0 is installed" in last


def test_another_mujoco_is_named(unloaded, monkeypatch):
    monkeypatch.setattr(mujoco, "__version__", "9.9.9")
    with pytest.raises(UnavailableError, match=r"built for MuJoCo 3\.17\.0, but 9\.9\.9"):
        library.load_plugin()


def test_a_missing_library_says_what_to_do(unloaded, monkeypatch, tmp_path):
    monkeypatch.setattr(library, "_FOLDER", tmp_path)
    with pytest.raises(UnavailableError, match=r"not built.*wheel.*apt-get install -y g\+\+"):
        library.load_plugin()


def test_a_broken_library_is_named(unloaded, monkeypatch, tmp_path):
    file = tmp_path / f"softgym_mj_plugins-mujoco-{mujoco.__version__}.so"
    file.write_bytes(b"not a library")
    monkeypatch.setattr(library, "_FOLDER", tmp_path)
    with pytest.raises(UnavailableError, match=file.name):
        library.load_plugin()


def test_a_copy_loaded_from_elsewhere_is_kept(tmp_path):
    copy = str(shutil.copy(library.load_plugin(), tmp_path / "copy.so"))
    script = textwrap.dedent(
        f"""
        import ctypes, threading
        import mujoco
        mujoco.mj_loadPluginLibrary({copy!r})
        from softgym_mj.native import library
        library.load_plugin()
        # Loading two would leave the lock of the dynamic linker held by the main thread.
        thread = threading.Thread(target=ctypes.CDLL, args=("libm.so.6",))
        thread.start()
        thread.join()
        """
    )
    subprocess.run([sys.executable, "-W", "ignore", "-c", script], check=True, timeout=60)


def readme_blocks(language):
    return [part.split("```")[0] for part in README.read_text().split(f"```{language}\n")[1:]]


def test_the_readme_model_runs():
    xml = readme_blocks("xml")[0]  # The other is the cloth contact's, tested there.
    library.load_plugin()
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 100)
    heights = data.plugin_state[1 : 1 + 3 * 512].reshape(-1, 3)[:, 2]
    assert heights.min() > 0.01 and heights.max() < 0.01 + 8.5 * 0.018


def test_the_readme_code_runs(monkeypatch):
    viewer, headless, mesh = readme_blocks("python")
    launched = []
    import mujoco.viewer

    monkeypatch.setattr(mujoco.viewer, "launch_from_path", launched.append)
    exec(compile(viewer, "viewer", "exec"), {})
    assert mujoco.MjModel.from_xml_path(*launched).nbody == 4
    names = {}
    exec(compile(headless, "headless", "exec"), names)
    image = names["image"].astype(int)
    water = (image[..., 2] > 110) & (image[..., 0] < 0.6 * image[..., 2])
    assert 0.1 < water.mean() < 0.4
    exec(compile(mesh, "mesh", "exec"), names)
    assert names["triangles"].shape == names["normals"].shape == (len(names["mesh"].faces), 3, 3)


def test_the_readme_lists_every_attribute():
    source = (README.parent / "config.cc").read_text()
    table = source.split("kAttributes[] = {")[1].split("};")[0]
    for attribute in table.replace('"', "").replace(",", " ").split():
        assert f"| `{attribute}` |" in README.read_text()


def without_compilers(folder):
    """An environment whose PATH has cmake, make and ninja, but no compiler."""
    for tool in ("cmake", "make", "ninja", "sh", "uname", "cat"):
        if found := shutil.which(tool):
            (folder / tool).symlink_to(found)
    kept = {key: value for key, value in os.environ.items() if key not in ("CC", "CXX")}
    return {**kept, "PATH": str(folder)}


@pytest.mark.slow
def test_a_wheel_runs_where_there_is_no_compiler(tmp_path):
    wheels, site, tools = tmp_path / "wheels", tmp_path / "site", tmp_path / "tools"
    pip = [sys.executable, "-m", "pip"]
    subprocess.run([*pip, "wheel", "-q", "--no-deps", "-w", wheels, ROOT], check=True)
    (wheel,) = wheels.glob("*.whl")
    assert "py3-none" in wheel.name
    assert any(name.endswith(".so") for name in zipfile.ZipFile(wheel).namelist())
    subprocess.run([*pip, "install", "-q", "--no-deps", "-t", site, wheel], check=True)
    tools.mkdir()
    script = textwrap.dedent(
        """
        import softgym_mj
        print(softgym_mj.__file__)
        env = softgym_mj.load("transport_water", fidelity="fast")
        env.reset(0)
        for _ in range(5):
            env.step([0.2])
        print(env.info()["performance"])
        """
    )
    # The interpreter itself, with what is installed here as mere files: without the hook that an
    # editable installation puts in front.
    path = os.pathsep.join([str(site), sysconfig.get_path("purelib")])
    environment = {**without_compilers(tools), "PYTHONPATH": path}
    result = subprocess.run(
        [sys._base_executable, "-c", script], env=environment, cwd=tmp_path,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith(str(site))
    assert -1.2 < float(result.stdout.split()[-1]) < -1.0


@pytest.mark.slow
def test_installing_from_source_without_a_compiler_says_so(tmp_path):
    tools = tmp_path / "tools"
    tools.mkdir()
    result = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--no-deps", "-w", tmp_path, ROOT],
        env=without_compilers(tools), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode != 0
    text = " ".join((result.stdout + result.stderr).split())
    assert "no C++ compiler was found" in text
    assert "apt-get install -y g++" in text
