"""Imports run one way, and the root has few modules."""

import ast
import pathlib

from tools.architecture import LAYERS

PACKAGE = pathlib.Path(__file__).parent.parent / "softgym_mj"
LAYER = {package: layer for layer, packages in enumerate(LAYERS) for package in packages}


def package(module: str) -> str:
    """Folder or root module that a dotted name is in."""
    return (*module.split("."), "__init__")[1]


def imported(file: pathlib.Path) -> set[str]:
    """The packages that a file imports from, within functions and for types, too."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("softgym_mj"):
            inner = node.module != "softgym_mj"
            names |= {node.module} if inner else {f"softgym_mj.{a.name}" for a in node.names}
        elif isinstance(node, ast.Import):
            names |= {a.name for a in node.names if a.name.split(".")[0] == "softgym_mj"}
    return {package(name) if package(name) in LAYER else "__init__" for name in names}


def test_imports_run_one_way():
    wrong = []
    for file in sorted(PACKAGE.rglob("*.py")):
        own = file.relative_to(PACKAGE).parts[0].removesuffix(".py")
        wrong += [
            f"{file.relative_to(PACKAGE)} imports {other}"
            for other in sorted(imported(file) - {own})
            if LAYER[other] >= LAYER[own]
        ]
    assert not wrong


def test_everything_has_a_floor():
    packages = {path.stem for path in PACKAGE.glob("*.py")}
    packages |= {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert packages == set(LAYER)


def test_the_root_has_few_modules():
    modules = {path.stem for path in PACKAGE.glob("*.py")}
    assert modules == {"__init__", "exceptions", "metrics", "registry", "validation"}


def test_no_task_imports_a_task():
    for file in (PACKAGE / "tasks").glob("[a-z]*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and "tasks" in (node.module or ""):
                assert node.module.startswith("softgym_mj.tasks.shared"), file


def test_tests_of_the_package_import_no_benchmarks():
    root = PACKAGE.parent / "tests"
    for file in set(root.rglob("*.py")) - set((root / "benchmarks").rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text())):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert "benchmarks" not in {name.split(".")[0] for name in names}, file
