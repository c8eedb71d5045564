"""Commands and errors that install extras are for a clone or a wheel; the extras exist."""

import pathlib
import re
import tomllib

import pytest

from softgym_mj.exceptions import UnavailableError, import_extra

ROOT = pathlib.Path(__file__).parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
PAGES = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
SOURCES = [*(ROOT / "softgym_mj").rglob("*.py")]


def test_extras_are_installed_from_a_clone_or_a_wheel():
    wrong = []
    for file in PAGES + SOURCES:
        text = file.read_text(encoding="utf-8")
        named = re.findall(r'import_extra\([^()]*"(\w+)"\)', text)
        for group in re.findall(r"'(?:\.|softgym_mj)\[([\w,]+)\]", text):
            named += group.split(",")
        on_index = re.search(r"softgym_mj\[(?![\w,{}]+\] @ file:)|pip install softgym_mj", text)
        if on_index or not set(named) <= set(EXTRAS):
            wrong.append(str(file.relative_to(ROOT)))
    assert not wrong


def test_a_missing_module_names_the_command():
    clone = r"`pip install '\.\[plot\]'` in a clone"
    wheel = r"`pip install 'softgym_mj\[plot\] @ file:///PATH/OF/THE/WHEEL\.whl'`"
    with pytest.raises(UnavailableError, match=rf"^Plots .*{clone}.* wheel .*{wheel}"):
        import_extra("no_such_module_here", "Plots", "plot")


def test_a_folder_of_the_same_name_is_no_module(tmp_path, monkeypatch):
    (tmp_path / "only_a_folder_here").mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(UnavailableError, match=r"^Plots is missing: run `pip"):
        import_extra("only_a_folder_here", "Plots", "plot")


def test_plots_need_matplotlib_alone():
    assert [re.match(r"[\w-]+", package)[0] for package in EXTRAS["plot"]] == ["matplotlib"]
