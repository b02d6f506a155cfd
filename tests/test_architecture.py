"""The layout of the package: who may import whom, and how large a file or function may be."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "mjhill"
FILES = sorted(PACKAGE.rglob("*.py"))

# each package may import those before it, the modules at the top, and itself
ORDER = (
    "analysis",
    "muscles",
    "joints",
    "engine",
    "simulate",
    "draw",
    "lab",
    "literature",
    "experiments",
    "ladder",
    "identification",
    "comparison",
    "report",
    "benchmarks",
    "cli",
)
BOTTOM = ("elements", "files", "frozen", "interrupts", "quantity")
ALONE = ("analysis",)  # import nothing of mjhill but themselves
LONGEST_FILE, LONGEST_FUNCTION = 500, 60


def module_name(path: Path) -> str:
    return ".".join(("mjhill", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
        ".__init__"
    )


MODULES = {module_name(path): path for path in FILES}


def imports(path: Path) -> set[str]:
    """Modules of mjhill that a file imports, at the top or inside a function."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                found.add(inner if inner in MODULES else node.module)
    return {name for name in found if name in MODULES}


def package_of(module: str) -> str:
    return module.split(".")[1] if "." in module else ""


@pytest.mark.parametrize("module", MODULES)
def test_imports_go_one_way(module):
    own = package_of(module)
    if own in ("", "__main__"):  # the face of the package may show all of it
        return
    for other in imports(MODULES[module]):
        package = package_of(other)
        if own in BOTTOM:
            assert package in BOTTOM, f"{module} imports {other}"
        elif own in ALONE:
            assert package == own, f"{module} imports {other}"
        elif package not in BOTTOM:
            assert package in ORDER, f"{module} imports {other}"
            assert ORDER.index(package) <= ORDER.index(own), f"{module} imports {other}"


def test_no_module_imports_itself_through_others():
    graph = {module: imports(path) - {module} for module, path in MODULES.items()}
    done: set[str] = set()

    def visit(module: str, trail: tuple[str, ...]) -> None:
        assert module not in trail, " -> ".join((*trail, module))
        if module in done:
            return
        for other in sorted(graph[module]):
            # a package's own face is there before its modules
            if not module.startswith(f"{other}.") and other != "mjhill":
                visit(other, (*trail, module))
        done.add(module)

    for module in graph:
        if module != "mjhill":
            visit(module, ())


def test_all_modules_can_be_imported_first_and_all_together():
    names = [name for name in MODULES if not name.endswith("__main__")]
    code = f"import importlib\nfor name in {names!r}: importlib.import_module(name)"
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)
    code = f"import importlib\nfor name in {names[::-1]!r}: importlib.import_module(name)"
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_a_file_and_its_functions_have_a_readable_size(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= LONGEST_FILE
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef) and not is_formula(node):
            lines = node.end_lineno - node.lineno + 1
            # what it says of itself and its arguments is no work to follow
            body = node.body[1:] if ast.get_docstring(node) else node.body
            work = node.end_lineno - body[0].lineno + 1 if body else 0
            assert work <= LONGEST_FUNCTION, f"{node.name} has {lines} lines"


def is_formula(node: ast.FunctionDef) -> bool:
    """Whether all that a function takes is floats: one equation of the muscle."""
    arguments = node.args.args + node.args.kwonlyargs
    kinds = {getattr(argument.annotation, "id", "") for argument in arguments}
    return bool(arguments) and kinds <= {"float", "bool"}
