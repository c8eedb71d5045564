"""The notebooks run from top to bottom and are committed with the outputs of their code."""

import base64
import io
import json
import pathlib
import re

import imageio.v3 as imageio
import numpy as np
import pytest
from PIL import Image

from tools import notebook_outputs

NOTEBOOKS = sorted((pathlib.Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
assert NOTEBOOKS

notebooks = pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
WIDEST = 101  # [characters] Longest line of an output that pages show whole, with its newline.
TRAINING_STEPS = 160  # Env steps in the test of 07_training, instead of 20,000.


# Cells appended to notebooks, which check the results of the cells above them.
CHECKS = {
    "01_quickstart": "assert len(yours) >= 10 and yours.min() > max(0.95, idle.max())",
    "09_images": "assert found['student'].mean() > 0.95 > found['does nothing'].mean()",
}


@pytest.mark.long
@notebooks
def test_notebook_runs(file, monkeypatch):
    import nbclient
    import nbformat

    monkeypatch.setenv("SOFTGYM_MJ_NOTEBOOK_STEPS", str(TRAINING_STEPS))
    notebook = nbformat.read(file, as_version=4)
    if file.stem in CHECKS:
        notebook.cells.append(nbformat.v4.new_code_cell(CHECKS[file.stem]))
    nbclient.NotebookClient(notebook, timeout=300).execute()
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    outputs = [output for cell in cells for output in cell.outputs]
    assert sum("image/png" in output.get("data", {}) for output in outputs) >= 3


@notebooks
def test_notebook_is_committed_with_a_picture_and_links_lead_to_files(file):
    cells = json.loads(file.read_text())["cells"]
    assert f"](../docs/notebooks/{file.stem}.jpg)" in "".join(cells[0]["source"])
    text = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", text):
        assert (file.parent / target).exists(), target


@notebooks
def test_committed_outputs_are_small_and_those_of_the_committed_code(file):
    notebook = json.loads(file.read_text())
    code = notebook_outputs.code_cells(notebook)
    assert notebook["metadata"][notebook_outputs.DIGEST] == notebook_outputs.digest(notebook), (
        "run `make outputs`"
    )
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    outputs = [output for cell in code for output in cell["outputs"]]
    assert any("image/jpeg" in output.get("data", ()) for output in outputs)
    lines = [line for output in outputs for line in output.get("text", ())]
    assert max(map(len, lines), default=0) <= WIDEST
    assert file.stat().st_size < 300_000


def executed(code, *outputs):
    cells = [
        {"cell_type": "code", "source": [source], "execution_count": number, "outputs": []}
        for number, source in enumerate(("install", code), 1)
    ]
    cells[1]["outputs"] = [dict(each) for each in outputs]
    return {"cells": cells, "metadata": {}}


def test_outputs_are_copied_as_texts_and_jpegs():
    png, mp4 = io.BytesIO(), io.BytesIO()
    Image.new("RGBA", (1400, 700), (0, 0, 255, 255)).save(png, "PNG")
    frames = np.stack([np.full((64, 64, 3), 60 * i, np.uint8) for i in range(4)])
    imageio.imwrite(mp4, frames, extension=".mp4", fps=2)
    encoded, video = (base64.b64encode(file.getvalue()).decode() for file in (png, mp4))
    html = f'<video src="data:video/mp4;base64,{video}">'
    run = executed(
        "show()",
        {"output_type": "stream", "name": "stdout", "text": "reward 1\n"},
        {"output_type": "stream", "name": "stderr", "text": "/home/me: UserWarning"},
        {"output_type": "display_data", "data": {"image/png": encoded, "text/plain": "<Figure>"}},
        {"output_type": "display_data", "data": {"text/html": html, "text/plain": "Video()"}},
    )
    copied = notebook_outputs.with_outputs(executed("show()"), run)
    text, figure, film = notebook_outputs.code_cells(copied)[1]["outputs"]
    assert text["text"] == ["reward 1\n"] and figure["data"]["text/plain"] == ["<Figure>"]
    pictures = [
        Image.open(io.BytesIO(base64.b64decode(out["data"]["image/jpeg"])))
        for out in (figure, film)
    ]
    assert [picture.size for picture in pictures] == [(700, 350), (256, 64)]
    assert np.allclose(pictures[0].getpixel((350, 175)), (0, 0, 255), atol=3)
    levels = [pictures[1].getpixel((32 + 64 * i, 32))[0] for i in range(4)]
    assert np.allclose(levels, [0, 60, 120, 180], atol=6)


def test_outputs_of_other_code_failures_and_paths_are_rejected():
    with pytest.raises(ValueError, match="the code has changed"):
        notebook_outputs.with_outputs(executed("one()"), executed("two()"))
    failure = {"output_type": "error", "ename": "TypeError", "evalue": "no"}
    with pytest.raises(ValueError, match="TypeError: no"):
        notebook_outputs.with_outputs(executed("one()"), executed("one()", failure))
    path = {"output_type": "stream", "name": "stdout", "text": "saved to /home/me/a.pt\n"}
    with pytest.raises(ValueError, match="absolute path"):
        notebook_outputs.with_outputs(executed("one()"), executed("one()", path))
