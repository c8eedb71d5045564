"""A hook of MkDocs: pages and files of the site that live outside docs/, with links adapted.

Links between them stay as they are in the repository, where they are read as well.
"""

import os.path
import pathlib
import re

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = pathlib.Path(__file__).parent.parent
# Files of the repository and the pages they become.
PAGES = {
    "README.md": "index.md",
    "softgym_mj/cloth/plugin/README.md": "cloth.md",
    "softgym_mj/fluid/plugin/README.md": "fluid.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
# Files that pages link to and that are copied as they are.
COPIES = [
    "CITATION.cff",
    *(f"notebooks/{path.name}" for path in sorted((ROOT / "notebooks").glob("*.ipynb"))),
]
_LINK = re.compile(r"(\]\()(?!https?:|#)([^)#\s]+)")


def page(source: str) -> str:
    """A file as a page of the site.

    Args:
        source: path within the repository, one of `PAGES`.
    """
    folder = os.path.dirname(source)

    def adapted(link: re.Match) -> str:
        target = os.path.normpath(os.path.join(folder, link[2]))
        if target in PAGES:
            return link[1] + PAGES[target]
        if target in COPIES:
            return link[1] + target
        return link[1] + os.path.relpath(target, "docs")  # Anything else is in docs/.

    return _LINK.sub(adapted, (ROOT / source).read_text(encoding="utf-8"))


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Adds the data sheets to the contents."""
    sheets = [{path.stem: f"tasks/{path.name}"} for path in sorted((ROOT / "docs/tasks").iterdir())]
    for entry in config.nav or []:
        if "Tasks" in entry:
            entry["Tasks"] = sheets
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages."""
    for source, target in PAGES.items():
        files.append(File.generated(config, target, content=page(source)))
    for source in COPIES:
        files.append(File.generated(config, source, abs_src_path=str(ROOT / source)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Makes links of docs/ to files outside of it lead to the pages they have become."""
    if page.file.src_uri in PAGES.values():
        return markdown  # Adapted when it was added.
    folder = os.path.dirname(page.file.src_uri)

    def adapted(link: re.Match) -> str:
        target = os.path.normpath(os.path.join("docs", folder, link[2]))
        return link[1] + os.path.relpath(PAGES[target], folder) if target in PAGES else link[0]

    return _LINK.sub(adapted, markdown)
