"""Badges lead to the notebooks and are replaced, not repeated."""

import json
import pathlib

import pytest

from tools import badges

ROOT = pathlib.Path(__file__).parents[2]
ADDRESS = "https://colab.research.google.com/github/a/b/blob/main/notebooks/01_quickstart.ipynb"
MARK = f"[![Open in Colab](https://colab.research.google.com/assets/colab-badge.svg)]({ADDRESS})"


def test_a_badge_is_below_the_title():
    once = badges.titled("# Quickstart\n\nTen tasks.", "a/b", "notebooks/01_quickstart.ipynb")
    assert once == f"# Quickstart\n\n{MARK}\n\nTen tasks."
    other = badges.titled(once, "c/d", "notebooks/01_quickstart.ipynb")
    assert other == once.replace("/a/b/", "/c/d/")


def test_the_list_has_a_badge_for_each():
    row = "| [01_quickstart](notebooks/01_quickstart.ipynb) | a rollout |"
    text = "See [01_quickstart](notebooks/01_quickstart.ipynb):\n" + row
    once = badges.listed(text, "a/b")
    assert once == text[: -len(" | a rollout |")] + f" {MARK} | a rollout |"
    assert badges.listed(once, "a/b") == once
    readme = badges.listed((ROOT / "README.md").read_text(), "a/b")
    files = list((ROOT / "notebooks").glob("*.ipynb"))
    assert readme.count("![Open in Colab]") == len(files)
    assert all(f"/a/b/blob/main/notebooks/{file.name})" in readme for file in files)


@pytest.mark.parametrize("file", sorted((ROOT / "notebooks").glob("*.ipynb")), ids=lambda f: f.stem)
def test_the_first_code_installs_what_is_missing(file):
    cells = json.loads(file.read_text())["cells"]
    texts = ["".join(cell["source"]) for cell in cells]
    first = next(t for t, cell in zip(texts, cells, strict=True) if cell["cell_type"] == "code")
    assert 'if find_spec("softgym_mj") is None:' in first
    words = "stable_baselines3", ".pt2"  # PyTorch loads policies from such files.
    needs_libraries = any(word in text for text in texts for word in words)
    assert ('%pip install --quiet "..[rl]"' in first) == needs_libraries
    published = badges.installing(first, "a/b")
    extras = "[rl]" if needs_libraries else ""
    assert f'%pip install --quiet "softgym_mj{extras} @ git+https://github.com/a/b"' in published
    assert badges.installing(published, "c/d") == published.replace("a/b", "c/d")
