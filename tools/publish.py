"""Writes the repository's address into the metadata of the package, before it is built.

    python -m tools.publish OWNER/NAME

Package indexes show README.md without the repository: links and pictures become absolute, and
pyproject.toml gets the project's addresses. The workflow that builds wheels runs it.
"""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).parent.parent
BRANCH = "main"
_LINK = re.compile(r"(!?\[[^\]\[]*\]\()(?!https?:|#)([^)\s]+)\)")


def absolute(text: str, repository: str) -> str:
    """Returns Markdown whose relative links and pictures lead to the repository on GitHub.

    Args:
        text: Markdown of a file in the repository's root.
        repository: "owner/name".
    """

    def adapted(link: re.Match) -> str:
        host = "https://raw.githubusercontent.com" if link[1][0] == "!" else "https://github.com"
        kind = "" if link[1][0] == "!" else "blob/"
        return f"{link[1]}{host}/{repository}/{kind}{BRANCH}/{link[2]})"

    return _LINK.sub(adapted, text)


def with_urls(text: str, repository: str) -> str:
    """Returns pyproject.toml with the addresses of the project on GitHub."""
    address = f"https://github.com/{repository}"
    owner, _, name = repository.partition("/")
    urls = {
        "Homepage": address,
        "Documentation": f"https://{owner}.github.io/{name}/",
        "Issues": f"{address}/issues",
        "Changelog": f"{address}/blob/{BRANCH}/CHANGELOG.md",
    }
    lines = [f'{title} = "{url}"' for title, url in urls.items()]
    before = "[project.optional-dependencies]"
    text = re.sub(r"\[project\.urls\]\n(.+\n)+\n", "", text)
    return text.replace(before, "\n".join(["[project.urls]", *lines, "", before]), 1)


def main(repository: str) -> None:
    if not re.fullmatch(r"[\w.-]+/[\w.-]+", repository):
        raise SystemExit(f"{repository!r} is not OWNER/NAME")
    for name, rewritten in (("README.md", absolute), ("pyproject.toml", with_urls)):
        file = ROOT / name
        file.write_text(rewritten(file.read_text(encoding="utf-8"), repository), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
