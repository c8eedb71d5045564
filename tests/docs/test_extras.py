"""Commands and errors that install extras work in a checkout and name extras that exist."""

import pathlib
import re
import tomllib

import pytest

from softgym_mj.exceptions import UnavailableError, import_extra

ROOT = pathlib.Path(__file__).parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
SOURCES = sorted((ROOT / "softgym_mj").rglob("*.py"))


@pytest.mark.parametrize("file", PAGES + SOURCES, ids=lambda file: str(file.relative_to(ROOT)))
def test_extras_are_installed_from_a_checkout(file):
    text = file.read_text(encoding="utf-8")
    assert "softgym_mj[" not in text and "pip install softgym_mj" not in text
    named = [part for group in re.findall(r"'?\.\[([\w,]+)\]'", text) for part in group.split(",")]
    named += re.findall(r'import_extra\([^()]*"(\w+)"\)', text)
    assert set(named) <= set(EXTRAS)


def test_a_missing_module_names_the_command():
    with pytest.raises(
        UnavailableError, match=r"^Plots .*`pip install '\.\[plot\]'` in a checkout"
    ):
        import_extra("no_such_module_here", "Plots", "plot")


def test_plots_need_matplotlib_alone():
    assert [re.match(r"[\w-]+", package)[0] for package in EXTRAS["plot"]] == ["matplotlib"]
