"""Version, license, changelog and citation of a release agree."""

import pathlib
import tomllib

import yaml

import softgym_mj

ROOT = pathlib.Path(__file__).parents[2]


def test_version_and_license_are_the_same_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert softgym_mj.__version__ == project["version"] == citation["version"]
    assert project["license"] == citation["license"] == "Apache-2.0"
    license = (ROOT / "LICENSE").read_text()
    assert "Apache License" in license and "Version 2.0, January 2004" in license
    assert f"\n## {softgym_mj.__version__} " in (ROOT / "CHANGELOG.md").read_text()


def test_the_source_distribution_has_the_packages_alone():
    """A new folder of the repository is excluded, or it is a package."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["scikit-build"]
    sources = (path for end in ("py", "md", "ipynb") for path in ROOT.glob(f"[a-z]*/*.{end}"))
    folders = {path.parent.name for path in sources}
    excluded = {name.removeprefix("/") for name in settings["sdist"]["exclude"]}
    assert folders - excluded == set(settings["wheel"]["packages"])
