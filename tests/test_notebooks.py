"""The notebooks run from top to bottom and are committed without outputs."""

import pathlib

import nbclient
import nbformat
import pytest

NOTEBOOKS = sorted((pathlib.Path(__file__).parent.parent / "notebooks").glob("*.ipynb"))
assert NOTEBOOKS

notebooks = pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)


@notebooks
def test_notebook_runs(file):
    notebook = nbformat.read(file, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300).execute()
    pictures = [
        output
        for cell in notebook.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        if "image/png" in output.get("data", {})
    ]
    assert len(pictures) >= 3


@notebooks
def test_notebook_is_committed_without_outputs(file):
    for cell in nbformat.read(file, as_version=4).cells:
        if cell.cell_type == "code":
            assert cell.outputs == [] and cell.execution_count is None
