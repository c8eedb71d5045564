"""What a release says of itself agrees: version, licence, changelog, citation."""

import pathlib
import tomllib

import yaml

import softgym_mj

ROOT = pathlib.Path(__file__).parents[2]


def test_version_and_licence_are_the_same_everywhere():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert softgym_mj.__version__ == project["version"] == citation["version"]
    assert project["license"] == citation["license"] == "Apache-2.0"
    licence = (ROOT / "LICENSE").read_text()
    assert "Apache License" in licence and "Version 2.0, January 2004" in licence
    assert f"\n## {softgym_mj.__version__} " in (ROOT / "CHANGELOG.md").read_text()
