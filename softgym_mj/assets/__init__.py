"""Shipped files: MJCF models and settled initial states."""

from importlib import resources


def path(*parts: str) -> str:
    """Returns the path of a shipped file, for example `path("arena.xml")`."""
    return str(resources.files(__name__).joinpath(*parts))
