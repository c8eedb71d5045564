"""Copies outputs of executed notebooks into notebooks/, where GitHub shows them.

    make outputs   # or: python -m tools.notebook_outputs build/notebooks

Texts stay, figures become JPEGs, a video four of its frames; warnings are left out. The notebook's
metadata has a digest of the code that was executed, which tests/docs/test_notebooks.py compares.
"""

import base64
import hashlib
import io
import json
import pathlib
import re
import sys
from typing import Any

import imageio.v3 as imageio
import numpy as np
from PIL import Image

FOLDER = pathlib.Path(__file__).parent.parent / "notebooks"
WIDTH, QUALITY = 700, 65  # Largest width [pixels] and quality of JPEGs.
FRAMES = 4  # Frames shown of a video.
DIGEST = "executed_code_sha256"  # Key of the notebook's metadata.
_VIDEO = re.compile(r'data:video/mp4;base64,([^"]+)')
# Absolute paths, which differ between machines.
MACHINE = re.compile(r"(?<![\w.])/(?:home|root|tmp|work|usr|var|Users)/")


def code_cells(notebook: dict[str, Any]) -> list[dict[str, Any]]:
    """Code cells of a notebook."""
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def digest(notebook: dict[str, Any]) -> str:
    """SHA-256 of the code, without the first cell: `tools.badges` changes what it installs."""
    sources = ["".join(cell["source"]) for cell in code_cells(notebook)[1:]]
    return hashlib.sha256(json.dumps(sources).encode()).hexdigest()


def jpeg(image: Image.Image) -> str:
    """JPEG in base64 of an image on white, at most `WIDTH` pixels wide."""
    image = image.convert("RGBA")
    flat = Image.alpha_composite(Image.new("RGBA", image.size, "white"), image).convert("RGB")
    if flat.width > WIDTH:
        size = WIDTH, round(flat.height * WIDTH / flat.width)
        flat = flat.resize(size, Image.Resampling.LANCZOS)
    file = io.BytesIO()
    flat.save(file, "JPEG", quality=QUALITY, optimize=True)
    return base64.b64encode(file.getvalue()).decode()


def picture(data: dict[str, Any]) -> Image.Image | None:
    """A figure, or frames of a video side by side from first to last; None if data has neither."""
    if "image/png" in data:
        return Image.open(io.BytesIO(base64.b64decode("".join(data["image/png"]))))
    if video := _VIDEO.search("".join(data.get("text/html", ""))):
        frames = imageio.imread(base64.b64decode(video[1]), extension=".mp4")
        chosen = np.linspace(0, len(frames) - 1, FRAMES).round().astype(int)
        return Image.fromarray(np.hstack(list(frames[chosen])))
    return None


def committed(output: dict[str, Any]) -> dict[str, Any] | None:
    """An output as it is committed; None for one that is left out.

    Raises:
        ValueError: if the cell failed, or the output has an absolute path.
    """
    if output["output_type"] == "error":
        raise ValueError(f"the cell failed: {output['ename']}: {output['evalue']}")
    if output.get("name") == "stderr":
        return None
    if output["output_type"] == "stream":
        text = "".join(output["text"])
        output = {**output, "text": text.splitlines(keepends=True)}
    else:
        text = "".join(output["data"]["text/plain"])
        data = {"text/plain": text.splitlines(keepends=True)}
        if image := picture(output["data"]):
            data = {"image/jpeg": jpeg(image)} | data
        output = {**output, "data": data}
    if MACHINE.search(text):
        raise ValueError(f"the output has an absolute path: {text}")
    return output


def with_outputs(notebook: dict[str, Any], executed: dict[str, Any]) -> dict[str, Any]:
    """A notebook with the outputs of its execution.

    Raises:
        ValueError: if the executed notebook has other code.
    """
    if digest(notebook) != digest(executed):
        raise ValueError("the code has changed since its execution")
    for cell, run in zip(code_cells(notebook), code_cells(executed), strict=True):
        cell["execution_count"] = run["execution_count"]
        cell["outputs"] = [kept for each in run["outputs"] if (kept := committed(each))]
        for output in cell["outputs"]:
            if "execution_count" in output:
                output["execution_count"] = cell["execution_count"]
    notebook["metadata"][DIGEST] = digest(notebook)
    return notebook


def main(folder: str) -> None:
    for file in sorted(FOLDER.glob("*.ipynb")):
        notebook = json.loads(file.read_text(encoding="utf-8"))
        executed = json.loads((pathlib.Path(folder) / file.name).read_text(encoding="utf-8"))
        text = json.dumps(with_outputs(notebook, executed), indent=1, ensure_ascii=False) + "\n"
        file.write_text(text, encoding="utf-8")
        print(f"{file.name}: {len(text.encode()) / 1e3:.0f} kB")


if __name__ == "__main__":
    main(*sys.argv[1:])
