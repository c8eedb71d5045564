"""Writes the experts' scores of docs/experts.json into README.md and the pages that show them."""

import json
import pathlib
import re

from benchmarks import experts

ROOT = pathlib.Path(__file__).parent.parent
README, ROBOTS, VALIDATION = "README.md", "docs/robots.md", "docs/validation.md"


def cells(actors: dict[str, dict[str, float]]) -> list[str]:
    """Mean and smallest score with each actor."""
    scores = [actors[actor].values() for actor in experts.ACTORS]
    return [f"{sum(values) / len(values):.2f} ({min(values):.2f})" for values in scores]


def replaced(text: str, pattern: str, by: str) -> str:
    """The text with its one match replaced."""
    text, count = re.subn(pattern, lambda match: match.expand(by), text)
    if count != 1:
        raise ValueError(f"{pattern} is {count} times in the page; expected once")
    return text


def pages() -> dict[pathlib.Path, str]:
    """The pages as they should be."""
    scores: experts.Scores = json.loads((ROOT / "docs" / "experts.json").read_text())
    texts = {path: (ROOT / path).read_text() for path in (README, ROBOTS, VALIDATION)}
    for task, actors in scores.items():
        found = cells(actors)
        row = rf"(\| \[`{task}`\]\([^|]*\|[^|]*\|) [^|]* \|"
        texts[README] = replaced(texts[README], row, rf"\1 {found[0]} |")
        row = rf"(\| `{task}` \|[^|]*\|) .* \|\n"
        texts[ROBOTS] = replaced(texts[ROBOTS], row, rf"\1 {' | '.join(found)} |\n")
    table = rf"{re.escape(experts.table({}))}(\n\|.*)+"
    texts[VALIDATION] = replaced(texts[VALIDATION], table, experts.table(scores))
    return {ROOT / path: text for path, text in texts.items()}


def main() -> None:
    for path, text in pages().items():
        path.write_text(text)


if __name__ == "__main__":
    main()
