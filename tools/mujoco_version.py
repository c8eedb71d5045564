"""The MuJoCo release that pyproject.toml pins; with `--set VERSION`, pins another one.

For the workflows: it needs nothing installed.
"""

import argparse
import pathlib
import re

PYPROJECT = pathlib.Path(__file__).parent.parent / "pyproject.toml"
# In the build's requirements, the dependencies and the extra "gpu".
_PIN = re.compile(r'(?<="mujoco==)[^"]+|(?<="mujoco-mjx\[warp\]==)[^"]+')


def pinned(text: str) -> str:
    """The release that the text of a pyproject.toml pins.

    Raises:
        ValueError: if it pins none, or several.
    """
    found = set(_PIN.findall(text))
    if len(found) != 1:
        raise ValueError(f"pyproject.toml pins MuJoCo {sorted(found)}; expected one release.")
    return found.pop()


def repinned(text: str, version: str) -> str:
    """The text of a pyproject.toml with another release pinned."""
    return _PIN.sub(version, text)


def main() -> None:
    """Prints the release, or pins another."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--set", metavar="VERSION")
    version = parser.parse_args().set
    text = PYPROJECT.read_text(encoding="utf-8")
    if version is None:
        print(pinned(text))
    else:
        PYPROJECT.write_text(repinned(text, version), encoding="utf-8")


if __name__ == "__main__":
    main()
