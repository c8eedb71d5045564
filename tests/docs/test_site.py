"""The documentation site builds without a warning and has every public module."""

import base64
import os
import pathlib
import re
import subprocess
import sys

import pytest

from softgym_mj.registry import DOMAIN, task_names

ROOT = pathlib.Path(__file__).parents[2]
REPOSITORY = "https://github.com/owner/name"
# Modules that are commands or their output, not an interface.
COMMANDS = ("cli", "console", "gymnasium_registration")


@pytest.mark.long
def test_the_site_builds_without_warnings(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    env = {**os.environ, "REPO_URL": REPOSITORY}
    built = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    home = (tmp_path / "index.html").read_text()
    for part in ('href="validation/"', 'href="fluid/"', 'src="videos/pour_water-wrist.webp"'):
        assert part in home
    for source in (ROOT / "notebooks").glob("*.ipynb"):
        page = (tmp_path / "notebooks" / source.stem / "index.html").read_text()
        assert f'href="notebooks/{source.stem}/"' in home and "find_spec" in page
        assert f'href="{REPOSITORY}/edit/main/notebooks/{source.name}"' in page
    arguments = 'href="../../arguments/"'  # It is ../docs/arguments.md in the notebook.
    assert arguments in (tmp_path / "notebooks" / "01_quickstart" / "index.html").read_text()
    robots = (tmp_path / "reference" / "robots" / "index.html").read_text()
    assert 'id="softgym_mj.robots.arm.arms.Arms.commanded_positions"' in robots


def test_a_notebook_is_shown_with_what_it_printed_pictures_and_videos(tmp_path):
    import nbformat  # Here: it compiles grammars for a second.

    from tools import site_pages

    picture = b"\x89PNG of nothing"
    data = {"image/png": base64.b64encode(picture).decode(), "text/plain": "<Figure>"}
    cell = nbformat.v4.new_code_cell("show()")
    video = {"text/html": '<video src="data:,"></video>', "text/plain": "Video(...)"}
    cell.outputs = [
        nbformat.v4.new_output("stream", text="reward -0.5\n"),
        nbformat.v4.new_output("display_data", data),
        nbformat.v4.new_output("display_data", video),
    ]
    nbformat.write(nbformat.v4.new_notebook(cells=[cell]), tmp_path / "own.ipynb")
    text, pictures = site_pages.notebook_page(tmp_path / "own.ipynb")
    ((name, content),) = pictures.items()
    assert content == picture and name.startswith("pictures/own")
    assert f"]({name})" in text and "show()" in text
    assert "\n    reward -0.5\n" in text and f"\n{video['text/html']}\n" in text
    assert video["text/plain"] not in text


def test_tables_have_classes_that_fit_them_to_phones():
    from tools import site_layout

    header = "<tr><th>task</th><th><code>ur5e</code></th><th>score</th><th>note</th></tr>"
    cells = (
        "<td><code>pour_water</code></td><td><img src='a.jpg'></td>"
        f"<td style='a'>0.86 (0.85 to 0.88), SAC</td><td>{'long ' * 9}</td>"
    )
    table = site_layout.with_classes(f"<table>\n{header}\n<tr>\n{cells}\n</tr></table>")
    assert header in table
    for cell in (
        "<td><code>pour_<wbr>water</code></td>",
        """<td class="picture" data-label="ur5e"><img src='a.jpg'></td>""",
        """<td style='a' class="number">0.86""",
        f'<td class="words">{"long " * 9}</td>',
    ):
        assert cell in table


def test_the_hero_is_a_grid_of_all_videos_with_captions():
    from tools import site_layout, videos

    assert list(site_layout.VIDEOS) == [*task_names(DOMAIN), *videos.ARMS]
    hero = '<p>A</p><p><img alt="All" src="videos/tasks.webp" /></p><p>B</p>'
    page = site_layout.on_page_content(hero, None, None, None)
    assert page.startswith("<p>A</p><div") and page.endswith("</div><p>B</p>")
    assert page.count("<figcaption>") == len(site_layout.VIDEOS) and "tasks.webp" not in page
    caption = "<figcaption>fold_<wbr>cloth, Franka</figcaption>"
    assert '<a href="tasks/fold_cloth/"><img src="videos/fold_cloth-tilted.webp"' in page
    assert caption in page


def test_the_reference_has_every_public_module():
    pages = "\n".join(path.read_text() for path in (ROOT / "docs" / "reference").glob("*.md"))
    listed = set(re.findall(r"^::: softgym_mj\.(\w+)", pages, re.MULTILINE))
    package = ROOT / "softgym_mj"
    public = {path.stem for path in package.glob("*.py") if not path.stem.startswith("_")}
    public |= {path.parent.name for path in package.glob("*/__init__.py")} - {"assets"}
    assert listed == {name for name in public if not name.startswith(COMMANDS)}
