"""The table of wrong changes fits the project; `python tests/mutations.py` makes them."""

import ast
import runpy

from places import ROOT


def test_lines_and_tests_of_all_changes_exist():
    changes = runpy.run_path(str(ROOT / "tests/mutations.py"))["CHANGES"]
    stale, names = [], {}
    every = [(file, *row) for file, rows in changes.items() for row in rows]
    for file, old, _, tests in every:
        path = ROOT / "src/seakeep" / file
        if not path.exists() or path.read_text("utf-8").count(old) != 1:
            stale.append((file, old))
        for place, name in (test.split("::") for test in tests.split()):
            if place not in names:
                body = ast.parse((ROOT / "tests" / place).read_text("utf-8")).body
                names[place] = {
                    each.name for each in body if isinstance(each, ast.FunctionDef | ast.ClassDef)
                }
            if name not in names[place]:
                stale.append((place, name))
    assert not stale, f"correct the table of tests/mutations.py: {stale}"
    assert len({change[:3] for change in every}) == len(every)
