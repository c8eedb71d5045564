"""Pages whose tables are made anew."""

import re


def replaced(text: str, pattern: str, by: str) -> str:
    """The text with its one match replaced."""
    text, count = re.subn(pattern, lambda match: match.expand(by), text)
    if count != 1:
        raise ValueError(f"{pattern} is {count} times in the page; expected once")
    return text


def table(head: str, rows: list[str]) -> str:
    """Markdown of a table with this first line."""
    return "\n".join([head, "|---" * (head.count("|") - 1) + "|", *rows])


def with_table(text: str, new: str) -> str:
    """A page with its table of the same first line replaced."""
    head = re.escape(new.splitlines()[0])
    return replaced(text, rf"{head}\n\|---.*(\n\|.*)*", new.replace("\\", r"\\"))


def between(text: str, name: str, new: str) -> str:
    """A page with what is between its comments `name` and `/name` replaced."""
    start, end = f"<!-- {name} -->", f"<!-- /{name} -->"
    inner = new.replace("\\", r"\\")
    return replaced(text, rf"{start}\n[\s\S]*?{end}", f"{start}\n{inner}\n{end}")
