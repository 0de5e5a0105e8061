"""The house keeps its floors: imports run downwards only."""

import ast
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "seakeep"

FLOORS = {
    "errors": 0,
    "files": 1,
    "interruption": 1,
    "waves": 1,
    "conventions": 2,
    "signals": 2,
    "core": 2,
    "pairing": 2,
    "metrics": 3,
    "statistics": 3,
    "tank": 3,
    "campaign": 3,
    "models": 3,
    "study": 4,
    "report": 5,
    "cli": 6,
    "__main__": 7,
    "__init__": 7,
}
# Rooms on one floor that may look into another one beside them.
NEIGHBOURS = {("signals", "conventions"), ("pairing", "signals")}
ONLY_IN_REPORT = {"matplotlib"}
CORE_MAY_USE = {"numpy", "scipy", "seakeep"} | set(sys.stdlib_module_names)


def room(path: Path) -> str:
    first = path.relative_to(SOURCE).parts[0]
    return first.removesuffix(".py")


def imported(path: Path) -> list[str]:
    names = []
    tree = ast.parse(path.read_text(encoding="utf-8"))
    # What only the type checker imports makes no circle when the program runs.
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import; write the full name"
            module = node.module or ""
            names += [f"{module}.{alias.name}" for alias in node.names]
    return names


FILES = sorted(SOURCE.rglob("*.py"))


def test_every_room_has_a_floor():
    assert {room(path) for path in FILES} <= set(FLOORS)


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(SOURCE)))
def test_imports_run_downwards(path):
    here = room(path)
    for name in imported(path):
        parts = name.split(".")
        if parts[0] in ONLY_IN_REPORT:
            assert here == "report", f"{name} belongs in report/"
        if here == "core":
            assert parts[0] in CORE_MAY_USE, f"core/ uses numpy and scipy only, not {name}"
        if parts[0] != "seakeep" or len(parts) == 1:
            continue
        there = parts[1] if parts[1] in FLOORS else "__init__"
        if there == here or (here, there) in NEIGHBOURS:
            continue
        assert FLOORS[there] < FLOORS[here], f"{here} (floor {FLOORS[here]}) imports {name}"


def test_no_import_circle():
    graph = {
        ".".join(("seakeep", *path.relative_to(SOURCE).with_suffix("").parts)).removesuffix(
            ".__init__"
        ): imported(path)
        for path in FILES
    }
    done: set[str] = set()

    def visit(name: str, trail: tuple[str, ...]) -> None:
        assert name not in trail, f"circle: {' -> '.join((*trail, name))}"
        if name in done:
            return
        for target in graph[name]:
            known = target if target in graph else target.rpartition(".")[0]
            if known in graph and known != name:
                visit(known, (*trail, name))
        done.add(name)

    for name in graph:
        visit(name, ())
