"""What says that an expert is another one than it was."""

import importlib
import pathlib
import shutil
import types

from softgym_mj.policies import experts
from softgym_mj.policies.experts import sources_sha256
from softgym_mj.registry import find


def test_every_file_of_experts_and_that_of_the_task_count(tmp_path, monkeypatch):
    first = sources_sha256(find("straighten_rope"))
    assert sources_sha256(find("spread_cloth")) != first
    copy = tmp_path / "experts"
    shutil.copytree(pathlib.Path(experts.__file__).parent, copy)
    monkeypatch.setattr(experts, "__file__", str(copy / "__init__.py"))
    assert sources_sha256(find("straighten_rope")) == first
    with (copy / "picker_expert.py").open("a") as stream:
        stream.write("# Another line.\n")
    assert sources_sha256(find("straighten_rope")) != first


def test_the_file_of_an_own_task_counts(tmp_path, monkeypatch):
    file = tmp_path / "own_pull.py"
    file.write_text("class Pull: pass\n")
    monkeypatch.syspath_prepend(tmp_path)
    task = types.SimpleNamespace(resolve=lambda: importlib.import_module("own_pull").Pull)
    first = sources_sha256(task)
    file.write_text("class Pull: more = 1\n")
    assert sources_sha256(task) != first


def test_the_class_of_a_notebook_has_no_file():
    name = type("Pull", (), {"__module__": "nowhere"})
    assert len(sources_sha256(types.SimpleNamespace(resolve=lambda: name))) == 64
