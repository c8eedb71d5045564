"""Writes Colab's badges into the notebooks and the README's list of them.

The notebooks' first cell then installs the package from that repository, instead of the clone.

    python -m tools.badges OWNER/NAME

of the repository on GitHub from which Colab reads them; those of another one are replaced.
"""

import json
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).parent.parent
BRANCH = "main"
PICTURE = "https://colab.research.google.com/assets/colab-badge.svg"
_BADGE = re.compile(r"\s*\[!\[Open in Colab\]\([^)]*\)\]\([^)]*\)")
_INSTALLED = re.compile(
    r"""(%pip install --quiet )"?(?:\.\.|softgym_mj)(?P<extras>\[[\w,]+\])?(?: @ \S+)?"?(?=\s|$)"""
)
_LISTED = re.compile(r"\[\w+\]\((notebooks/\w+\.ipynb)\)")


def badge(repository: str, path: str) -> str:
    """Markdown that opens a notebook in Colab.

    Args:
        repository: "owner/name".
        path: of the notebook within it.
    """
    address = f"https://colab.research.google.com/github/{repository}/blob/{BRANCH}/{path}"
    return f"[![Open in Colab]({PICTURE})]({address})"


def titled(text: str, repository: str, path: str) -> str:
    """The first cell of a notebook, with its badge below the title."""
    title, *rest = _BADGE.sub("", text).split("\n")
    return "\n".join([title, "", badge(repository, path), *rest])


def installing(code: str, repository: str) -> str:
    """A notebook's first code cell that installs the package from GitHub.

    Args:
        code: the cell; it installs the clone or another repository.
        repository: "owner/name".
    """
    address = f"git+https://github.com/{repository}"
    return _INSTALLED.sub(
        lambda found: f'{found[1]}"softgym_mj{found["extras"] or ""} @ {address}"', code
    )


def listed(text: str, repository: str) -> str:
    """A README, with a badge behind each link to a notebook in the rows of a table."""
    rows = [
        _LISTED.sub(lambda link: f"{link[0]} {badge(repository, link[1])}", line)
        if line.startswith("| [")
        else line
        for line in _BADGE.sub("", text).split("\n")
    ]
    return "\n".join(rows)


def main(repository: str) -> None:
    if not re.fullmatch(r"[\w.-]+/[\w.-]+", repository):
        raise SystemExit(f"{repository!r} is no OWNER/NAME")
    for file in sorted((ROOT / "notebooks").glob("*.ipynb")):
        notebook = json.loads(file.read_text(encoding="utf-8"))
        first = notebook["cells"][0]
        text = titled("".join(first["source"]), repository, f"notebooks/{file.name}")
        first["source"] = text.splitlines(keepends=True)
        code = next(cell for cell in notebook["cells"] if cell["cell_type"] == "code")
        code["source"] = installing("".join(code["source"]), repository).splitlines(keepends=True)
        file.write_text(json.dumps(notebook, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    readme = ROOT / "README.md"
    readme.write_text(listed(readme.read_text(encoding="utf-8"), repository), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
