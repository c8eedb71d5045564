"""A hook of MkDocs: HTML of tables and of the hero video that fits small screens.

docs/stylesheets/tables.css styles the classes that it adds.
"""

import html
import re

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import Files
from mkdocs.structure.pages import Page

# The videos of docs/videos/tasks.webp in its order, and their captions.
TASKS = (
    "drop_cloth", "drop_fold_cloth", "fold_cloth", "fold_crumpled_cloth", "pour_water",
    "pour_water_amount", "rope_configuration", "spread_cloth", "straighten_rope", "transport_water",
)  # fmt: skip
VIDEOS = {
    **{name: name for name in TASKS},
    "fold_cloth-tilted": "fold_cloth, Franka",
    "pour_water-wrist": "pour_water, UR5e",
}
LONGEST = 40  # [characters] Longer cells are sentences; shorter ones that are numbers do not wrap.
_HERO = re.compile(r'<p><img [^>]*src="videos/tasks\.webp"[^>]*></p>')
_TABLE = re.compile(r"<table>.*?</table>", re.DOTALL)
_ROW = re.compile(r"<tr>.*?</tr>", re.DOTALL)
_CELL = re.compile(r"<(t[hd])([^>]*)>(.*?)</\1>", re.DOTALL)
_CODE = re.compile(r"<code>.*?</code>")


def words(cell: str) -> str:
    """Text of a cell."""
    return html.unescape(re.sub("<[^>]*>", "", cell)).strip()


def tiles() -> str:
    """The videos of all tasks as a grid, each with its name beneath."""
    figures = (
        f'<figure><a href="tasks/{name.split("-")[0]}/">'
        f'<img src="videos/{name}.webp" alt="{caption}" loading="lazy">'
        f"<figcaption>{_breakable(caption)}</figcaption></a></figure>"
        for name, caption in VIDEOS.items()
    )
    return f'<div class="tiles">{"".join(figures)}</div>'


def _breakable(name: str) -> str:
    """HTML of a name that may be broken after its underscores."""
    return name.replace("_", "_<wbr>")


def with_classes(table: str) -> str:
    """A table whose cells have the classes "number", "words" or "picture" and, then, a label."""
    header = [words(cell[2]) for cell in _CELL.findall(_ROW.findall(table)[0])]

    def row(found: re.Match[str]) -> str:
        cells = _CELL.findall(found[0])
        return f"<tr>{''.join(cell(k, *parts) for k, parts in enumerate(cells))}</tr>"

    def cell(column: int, tag: str, attributes: str, content: str) -> str:
        text = words(content)
        if tag == "td" and "<img" in content:
            attributes += f' class="picture" data-label="{html.escape(header[column])}"'
        elif tag == "td" and len(text) > LONGEST:
            attributes += ' class="words"'
        elif tag == "td" and re.match(r"[-<±]?\d", text):
            attributes += ' class="number"'
        content = _CODE.sub(lambda code: _breakable(code[0]), content)
        return f"<{tag}{attributes}>{content}</{tag}>"

    return _ROW.sub(row, table)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Adds classes to the cells of tables; the hero video becomes a grid of videos."""
    del page, config, files
    html = _HERO.sub(lambda _: tiles(), html)
    return _TABLE.sub(lambda table: with_classes(table[0]), html)
