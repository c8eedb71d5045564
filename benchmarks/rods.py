"""Collects results of solvers in cosseratbench, a benchmark of slender rods, in one file.

    pip install '.[cosserat]'
    cosseratbench run --solver softgym_mj --vary all --out results
    python -m benchmarks.rods results --out docs/rods.json

The benchmark writes a folder per experiment, variant and solver. Of each result.json the file has
everything but the provenance; docs/reality.md shows it (tools/rod_tables.py).
"""

import argparse
import importlib.metadata
import pathlib
from typing import Any

from softgym_mj.exceptions import StoreError
from softgym_mj.storage.files import read_json, write_json

_LEFT_OUT = "provenance", "values", "options"


def collect(folder: pathlib.Path) -> list[dict[str, Any]]:
    """Returns results in a folder of cosseratbench, in order of experiment, variant and solver.

    Raises:
        StoreError: If there is none.
    """
    found = []
    for path in sorted(folder.glob("*/*/*/result.json")):
        result = read_json(path)
        kept = {key: value for key, value in result.items() if key not in _LEFT_OUT}
        found.append({"variant": path.parts[-3], **kept})
    if not found:
        raise StoreError(f"{folder}: no results of cosseratbench")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    release = importlib.metadata.version("cosseratbench")
    results = collect(arguments.folder)
    write_json(arguments.out, {"benchmark": f"cosseratbench {release}", "results": results})


if __name__ == "__main__":
    main()
