"""A hook of MkDocs: pages of the site that live outside docs/, and links that hold there.

Links stay as they are in the repository, where they are read as well.
"""

import os.path
import pathlib
import re

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page
from nbconvert import MarkdownExporter

ROOT = pathlib.Path(__file__).parent.parent
NOTEBOOKS = sorted(path.name for path in (ROOT / "notebooks").glob("*.ipynb"))
# Files of the repository and the pages they become.
PAGES = {
    "README.md": "index.md",
    "softgym_mj/cloth/plugin/README.md": "cloth.md",
    "softgym_mj/fluid/plugin/README.md": "fluid.md",
    "lerobot_env_softgym_mj/README.md": "lerobot.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    **{f"notebooks/{name}": f"notebooks/{name.removesuffix('.ipynb')}.md" for name in NOTEBOOKS},
}
_SOURCES = {page: source for source, page in PAGES.items()}
COPIES = ["CITATION.cff"]  # Files that pages link to and that are copied as they are.
# Factors of pages in the site's search, by the start of their names: guides come first. A match in
# a title counts 1,000 times as much as in the text.
SEARCH_BOOSTS = {
    "reference/": 1e-4, "changelog.md": 1e-4, "contributing.md": 5e-4, "tasks/": 2e-2,
    "architecture.md": 1e-2, "softgym.md": 2e-3, "notebooks/": 0.1, "migration.md": 0.1,
    "interface.md": 3.0, "robots.md": 3.0,
}  # fmt: skip
_LINK = re.compile(r"(\]\()(?!https?:|#)([^)#\s]+)")


def notebook_page(file: pathlib.Path) -> tuple[str, dict[str, bytes]]:
    """A notebook as Markdown, and its pictures by name.

    Args:
        file: the notebook, with or without outputs.
    """
    notebook = nbformat.read(file, as_version=4)
    settings = {"unique_key": file.stem, "output_files_dir": "pictures"}
    text, resources = MarkdownExporter().from_notebook_node(notebook, settings)
    return text, resources["outputs"]


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Adds the data sheets and the notebooks to the navigation."""
    sheets = [{path.stem: f"tasks/{path.name}"} for path in sorted((ROOT / "docs/tasks").iterdir())]
    notebooks = [PAGES[f"notebooks/{name}"] for name in NOTEBOOKS]
    start, tasks = config.nav[:2]
    tasks["Tasks"] += sheets
    next(entry for entry in start["Start"] if "Notebooks" in entry)["Notebooks"] = notebooks
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the pages, with the notebooks of the folder that the settings name."""
    for source, target in PAGES.items():
        if source.endswith(".md"):
            text = (ROOT / source).read_text(encoding="utf-8")
        else:
            folder = ROOT / config.extra["notebooks"]
            text, pictures = notebook_page(folder / os.path.basename(source))
            for name, content in pictures.items():
                files.append(File.generated(config, f"notebooks/{name}", content=content))
        files.append(File.generated(config, target, content=text))
    for source in COPIES:
        files.append(File.generated(config, source, abs_src_path=str(ROOT / source)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Resolves links to files of the repository; the edit link leads to the page's source."""
    here = page.file.src_uri
    for start, boost in SEARCH_BOOSTS.items():
        if here.startswith(start):
            page.meta["search"] = {"boost": boost}
    source = _SOURCES.get(here, f"docs/{here}")
    if config.repo_url:
        page.edit_url = f"{config.repo_url.rstrip('/')}/edit/main/{source}"

    def adapted(link: re.Match) -> str:
        target = os.path.normpath(os.path.join(os.path.dirname(source), link[2]))
        if not (ROOT / target).exists():  # MkDocs says so, or it is a picture of a notebook.
            return link[0]
        there = PAGES.get(target, target.removeprefix("docs/"))
        return link[1] + os.path.relpath(there, os.path.dirname(here))

    return _LINK.sub(adapted, markdown)
