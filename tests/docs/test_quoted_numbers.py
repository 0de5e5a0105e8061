"""Numbers that a page quotes are those of the file, or of the coefficients, that they come from."""

import re

from near import assert_near
from pages import page
from places import ROOT

TANK, STUDY = page("virtual_tank.md"), page("study.md")


def rows(text, first):
    """Rows of a table, whose heading begins with a cell, by their first cell."""
    lines = text[text.index(f"| {first} |") :].split("\n\n")[0].splitlines()[2:]
    cells = ([each.strip() for each in line.split("|")[1:-1]] for line in lines)
    return {row[0]: row[1:] for row in cells}


def results(name):
    return (ROOT / "benchmarks" / "results" / f"{name}.md").read_text("utf-8")


def test_steps_to_the_recommended_model():
    made = rows(results("steps_on_tank"), "step")
    plain = {step: [cell.split(" (")[0] for cell in row] for step, row in made.items()}
    assert rows(STUDY, "step") == plain


def test_the_study_with_half_of_the_losses():
    """Slow channels, then wave channels: recommended and the paper's, with half and with all."""
    half, whole = (rows(results(name), "step") for name in ("steps_half_losses", "steps_on_tank"))
    ours, papers = "read-outs of the loads: `recommended`", next(iter(whole))
    made = [
        of[step][column].split(" (")[0]
        for column in (1, 0)
        for step in (ours, papers)
        for of in (half, whole)
    ]
    said = TANK[TANK.index("out, slow channels err") : TANK.index("The test measures the losses")]
    quoted = [float(each) for each in re.findall(r"\d+\.\d+", said)]
    slow, waves = made[:4], [made[4], made[6], made[5], made[7]]  # "0.062 and 0.395 instead of …"
    assert_near(quoted, [float(each) for each in slow + waves], 0.0051)


def test_what_alignment_brings():
    paper, ours = (
        rows(part, "alignment") for part in results("alignment_on_tank").split("## Preset")[1:]
    )
    for (mode, row), name in zip(
        rows(TANK, "alignment").items(),
        ("measured, dispersion ¹", "measured, effective ¹", "predicted, dispersion", "none"),
        strict=True,
    ):
        made = [cell for table in (paper, ours) for cell in table.get(name, ["–", ""])[:2]]
        assert [cell.replace("−", "-") for cell in row] == made, mode
