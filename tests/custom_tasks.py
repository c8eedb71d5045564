"""Code of docs/custom_tasks.md."""

import pathlib
import re
from typing import Any

_PAGE = pathlib.Path(__file__).parents[1] / "docs" / "custom_tasks.md"


def defined_with(name: str) -> dict[str, Any]:
    """Runs the block that defines a class; returns all that it defines."""
    (code,) = re.findall(rf"```python\n([^`]*class {name}[^`]*)```", _PAGE.read_text())
    namespace: dict[str, Any] = {"__name__": "page"}
    exec(code, namespace)
    return namespace
