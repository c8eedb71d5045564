"""The workflows are valid YAML, name what exists, and find MuJoCo's release."""

import importlib
import importlib.metadata
import importlib.util
import pathlib
import re
import tomllib

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import softgym_mj.envs
from softgym_mj.exceptions import UnavailableError
from tools import mujoco_version

ROOT = pathlib.Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_name_what_exists(path):
    text = path.read_text()
    jobs = yaml.safe_load(text)["jobs"]
    for job in jobs.values():
        assert job["runs-on"] and job["timeout-minutes"]
        assert all(("run" in step) != ("uses" in step) for step in job["steps"])
    for script in re.findall(r"(?:python|bash) ((?:tools|\.ci)/\S+?)[\s)]", text):
        assert (ROOT / script).is_file(), script
    extras = PROJECT["optional-dependencies"]
    for extra in re.findall(r"'\.\[(\w+)\]'", text):
        assert extra in extras


def test_a_release_waits_for_its_demo():
    jobs = yaml.safe_load((ROOT / ".github" / "workflows" / "wheels.yml").read_text())["jobs"]
    publish = jobs["publish"]
    assert set(publish["needs"]) == set(jobs) - {"publish"}
    assert publish["if"] == "startsWith(github.ref, 'refs/tags/v')"
    assert publish["permissions"] == {"id-token": "write"}
    kept = jobs["demo"]["steps"][1]["with"]["name"].removeprefix("wheel-")
    assert kept in jobs["wheel"]["strategy"]["matrix"]["os"]


def test_the_image_is_made_of_what_is_there():
    kept = re.findall(r"^!(.*)$", (ROOT / ".dockerignore").read_text(), re.MULTILINE)
    assert all((ROOT / name).exists() for name in kept)
    assert {PROJECT["readme"], *PROJECT["license-files"], "pyproject.toml"} <= set(kept)
    image = (ROOT / "Dockerfile").read_text()
    libraries = "libegl1 libgl1-mesa-dri libopengl0"
    assert libraries in image and libraries in (ROOT / "tools" / "setup.sh").read_text()
    assert f'["{next(iter(PROJECT["scripts"]))}"]' in image


def test_all_say_the_same_of_python():
    listed = [text.split()[-1] for text in PROJECT["classifiers"] if "Python ::" in text]
    tested, last = listed[:2], listed[-1]  # The others have no wheels of labmaze.
    above = f"{last.split('.')[0]}.{int(last.split('.')[1]) + 1}"
    assert PROJECT["requires-python"] == f">={listed[0]},<{above}"
    workflows = {path.stem: yaml.safe_load(path.read_text()) for path in WORKFLOWS}
    for workflow, job, versions in (("ci", "test", tested), ("wheels", "demo", listed)):
        assert workflows[workflow]["jobs"][job]["strategy"]["matrix"]["python"] == versions
    assert all(
        f"python:{tested[-1]}-slim" in line
        for line in (ROOT / "Dockerfile").read_text().splitlines()
        if line.startswith("FROM")
    )
    built = (ROOT / ".github" / "workflows" / "wheels.yml").read_text()
    assert " ".join(f"cp{name.replace('.', '')}-*" for name in tested) in built
    assert f"Python {' or '.join(tested)}" in (ROOT / "README.md").read_text()


@pytest.mark.parametrize("version", ["3.13", "3.14"])
def test_python_without_labmaze_gets_all_else_that_dm_control_needs(version):
    above = {"python_version": version, "extra": ""}

    def needed(lines):
        requirements = [Requirement(line) for line in lines]
        return {
            canonicalize_name(one.name): one
            for one in requirements
            if one.marker is None or one.marker.evaluate(above)
        }

    own, theirs = needed(PROJECT["dependencies"]), needed(importlib.metadata.requires("dm-control"))
    assert set(theirs) - set(own) == {"labmaze"}
    command = next(
        line for line in PROJECT["dependencies"] if line.startswith("dm-control")
    ).partition(";")[0]
    for file in (
        "docs/quickstart.md", "tools/setup.sh", "softgym_mj/envs/__init__.py",
        ".github/workflows/wheels.yml",
    ):  # fmt: skip
        assert f"--no-deps '{command}'" in (ROOT / file).read_text()


def test_a_missing_dm_control_names_the_command(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(UnavailableError, match="pip install --no-deps 'dm-control"):
        importlib.reload(softgym_mj.envs)


def test_the_pinned_mujoco_is_the_one_installed_and_can_be_replaced():
    text = (ROOT / "pyproject.toml").read_text()
    assert mujoco_version.pinned(text) == importlib.metadata.version("mujoco")
    other = tomllib.loads(mujoco_version.repinned(text, "9.9.9"))
    assert "mujoco==9.9.9" in other["build-system"]["requires"]
    assert "mujoco==9.9.9" in other["project"]["dependencies"]
    with pytest.raises(ValueError, match="expected one release"):
        mujoco_version.pinned(text.replace('"mujoco==', '"mujoco==9', 1))
