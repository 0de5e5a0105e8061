"""The layout of the package: imports run downwards only, and no two modules import each other.

Every import counts: at the top of a module, inside a function, and for the type checker alone.
"""

import ast
import graphlib
import sys

import pytest
from places import ROOT

SOURCE = ROOT / "src/seakeep"

FLOORS = (
    ("errors",),
    ("arrays",),
    ("executor",),
    ("files",),
    ("conventions", "waves"),
    ("toml",),
    ("core",),
    ("signals",),
    ("pairing",),
    ("metrics", "statistics"),
    ("quality",),
    ("formats",),
    ("campaign",),
    ("tank",),
    ("models",),
    ("baselines", "hosts"),
    ("check",),
    ("study",),
    ("report",),
    ("plot",),
    ("tuning",),
    ("cli",),
    ("__main__", "__init__"),
)
"""From the ground up. A room imports those below it, and none on its own floor."""

CORE_MAY_USE = {"numpy", "scipy", "seakeep"} | set(sys.stdlib_module_names)


def module_name(path):
    parts = path.relative_to(SOURCE.parent).with_suffix("").parts
    return ".".join(parts).removesuffix(".__init__")


MODULES = {module_name(path): path for path in sorted(SOURCE.rglob("*.py"))}
ROOMS = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}


def room_of(module):
    """The room of a module of ours; the package itself is its top floor."""
    return module.split(".")[1] if "." in module else "__init__"


def imported(path):
    """Modules that a file imports anywhere: ours in full, others by their first name."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import; write the full name"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    ours = {name for name in names if name.split(".")[0] == "seakeep"}
    found = {name if name in MODULES else name.rpartition(".")[0] for name in ours}
    return found | {name.split(".")[0] for name in names - ours}


GRAPH = {name: imported(path) for name, path in MODULES.items()}


def broken_rule(module, target):
    """The rule that an import breaks, if any."""
    here, there = room_of(module), room_of(target)
    if target.split(".")[0] != "seakeep":
        if target == "matplotlib" and here not in ("report", "plot"):
            return f"{target} belongs in report/"
        if here in ("core", "signals") and target in ("xarray", "pandas"):
            return f"{here}/ knows arrays only"
        if here == "core" and target not in CORE_MAY_USE:
            return "core/ uses numpy and scipy only"
    elif here != there and ROOMS[there] >= ROOMS[here]:
        return f"{here} lies below {there}, or beside it"
    elif here == "models" and there in ("campaign", "tank"):  # although it lies above them
        return f"{here} and {there} do not know each other"
    return None


def test_imports_run_downwards():
    assert {
        (module, target): rule
        for module, targets in GRAPH.items()
        for target in targets
        if (rule := broken_rule(module, target)) is not None
    } == {}


def test_no_import_circle():
    graph = {module: targets & MODULES.keys() - {module} for module, targets in GRAPH.items()}
    try:
        graphlib.TopologicalSorter(graph).prepare()
    except graphlib.CycleError as circle:
        pytest.fail(" imports ".join(reversed(circle.args[1])))
