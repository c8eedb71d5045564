"""The documentation site builds without a warning and has every public module."""

import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).parents[2]
# Modules that are commands or their output, not an interface.
COMMANDS = ("cli", "console", "gymnasium_registration")


def test_the_site_builds_without_warnings(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    home = (tmp_path / "index.html").read_text()
    for part in ('href="validation/"', 'href="fluid/"', 'src="films/tasks.webp"'):
        assert part in home
    assert (tmp_path / "notebooks" / "01_quickstart.ipynb").is_file()
    robots = (tmp_path / "reference" / "robots" / "index.html").read_text()
    assert 'id="softgym_mj.robots.arms.Arms.commanded_positions"' in robots


def test_the_reference_has_every_public_module():
    pages = "\n".join(path.read_text() for path in (ROOT / "docs" / "reference").glob("*.md"))
    listed = set(re.findall(r"^::: softgym_mj\.(\w+)", pages, re.MULTILINE))
    package = ROOT / "softgym_mj"
    public = {path.stem for path in package.glob("*.py") if not path.stem.startswith("_")}
    public |= {path.parent.name for path in package.glob("*/__init__.py")} - {"assets"}
    assert listed == {name for name in public if not name.startswith(COMMANDS)}
