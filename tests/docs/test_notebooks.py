"""The notebooks run from top to bottom and are committed without outputs."""

import json
import pathlib
import re

import pytest

NOTEBOOKS = sorted((pathlib.Path(__file__).parents[2] / "notebooks").glob("*.ipynb"))
assert NOTEBOOKS

notebooks = pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
TRAINING_STEPS = 160  # Of the agent in 07_training, which learns from 20,000.


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
def test_notebook_is_committed_with_a_picture_without_outputs_and_links_lead_to_files(file):
    cells = json.loads(file.read_text())["cells"]
    for cell in cells:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [] and cell["execution_count"] is None
    assert f"](../docs/notebooks/{file.stem}.jpg)" in "".join(cells[0]["source"])
    text = "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "markdown")
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", text):
        assert (file.parent / target).exists(), target
