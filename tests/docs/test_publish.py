"""The package's long description has absolute links only, and the project its addresses."""

import pathlib
import re
import tomllib

from tools import publish

ROOT = pathlib.Path(__file__).parents[2]


def test_links_and_pictures_by_hand():
    text = "[a](docs/a.md#b) ![c](docs/c.png) [d](https://d.e) [f](#g)"
    assert publish.absolute(text, "o/n") == (
        "[a](https://github.com/o/n/blob/main/docs/a.md#b) "
        "![c](https://raw.githubusercontent.com/o/n/main/docs/c.png) [d](https://d.e) [f](#g)"
    )


def test_every_link_of_the_readme_becomes_absolute_and_leads_to_a_file():
    text = publish.absolute((ROOT / "README.md").read_text(), "o/n")
    targets = re.findall(r"\]\(([^)\s]+)\)", text)
    assert all(target.startswith("https://") for target in targets)
    own = [target.split("/main/")[1] for target in targets if "/o/n/" in target]
    assert len(own) > 40
    assert all((ROOT / target.split("#")[0]).is_file() for target in own)
    assert publish.absolute(text, "o/n") == text


def test_the_project_has_its_addresses():
    text = (ROOT / "pyproject.toml").read_text()
    once = publish.with_urls(text, "o/n")
    project = tomllib.loads(once)["project"]
    assert project["urls"]["Homepage"] == "https://github.com/o/n"
    assert project["urls"]["Documentation"] == "https://o.github.io/n/"
    assert publish.with_urls(once, "o/n") == once
    del project["urls"]
    assert project == tomllib.loads(text)["project"]
