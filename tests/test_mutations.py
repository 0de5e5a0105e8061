"""The table of wrong changes fits the project; `python tests/mutations.py` makes them."""

import ast
import runpy
from pathlib import Path

HERE = Path(__file__).parent


def test_lines_and_tests_of_all_changes_exist():
    changes = runpy.run_path(str(HERE / "mutations.py"))["CHANGES"]
    sources = {
        file: (HERE.parent / "src/seakeep" / file).read_text("utf-8") for file, *_ in changes
    }
    stale = [(file, old) for file, old, *_ in changes if sources[file].count(old) != 1]
    for test in {test for change in changes for test in change[3].split()}:
        path, name = test.partition("[")[0].split("::")
        body = ast.parse((HERE / path).read_text("utf-8")).body
        if name not in {item.name for item in body if isinstance(item, ast.FunctionDef)}:
            stale.append(test)
    assert not stale, f"correct the table of tests/mutations.py: {stale}"
    assert len({change[:3] for change in changes}) == len(changes)
