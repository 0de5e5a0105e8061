"""Numbers that a page quotes are those of the file, or of the coefficients, that they come from."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

ROOT = Path(__file__).parents[2]
TANK, STUDY = (
    (ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("virtual_tank.md", "study.md")
)


def rows(text, first):
    """Rows of a table, whose heading begins with a cell, by their first cell."""
    lines = text[text.index(f"| {first} |") :].split("\n\n")[0].splitlines()[2:]
    cells = ([each.strip() for each in line.split("|")[1:-1]] for line in lines)
    return {row[0]: row[1:] for row in cells}


def results(name):
    return (ROOT / "benchmarks" / "results" / f"{name}.md").read_text(encoding="utf-8")


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
        for steps in [(ours, papers)]
        for step in steps
        for of in (half, whole)
    ]
    said = TANK[TANK.index("out, slow channels err") : TANK.index("The test measures the losses")]
    quoted = [float(each) for each in re.findall(r"\d+\.\d+", said)]
    slow, waves = made[:4], [made[4], made[6], made[5], made[7]]  # "0.062 and 0.395 instead of …"
    assert quoted == pytest.approx([float(each) for each in slow + waves], abs=0.0051)


def test_what_alignment_brings():
    paper, ours = (
        rows(part, "alignment") for part in results("alignment_on_tank").split("## Preset")[1:]
    )
    quoted = rows(TANK, "alignment")
    assert len(quoted) == 4
    for (mode, row), name in zip(
        quoted.items(),
        ("measured, dispersion ¹", "measured, effective ¹", "predicted, dispersion", "none"),
        strict=True,
    ):
        made = [cell for table in (paper, ours) for cell in table.get(name, ["–", ""])[:2]]
        assert [cell.replace("−", "-") for cell in row] == made, mode


def test_where_the_solver_is_weakest():
    pytest.importorskip("numba", reason="the virtual tank's time loop")
    from seakeep.tank.dynamics import assemble_rig, linear_response
    from seakeep.tank.hydrodynamics import excitation_at, load_hydrodynamics
    from seakeep.tank.settings import default_settings
    from seakeep.waves import wavelength_to_frequency

    hydro = load_hydrodynamics()
    rig = assemble_rig(default_settings(), hydro)
    damping = rig.linear_damping.copy()
    damping[0, 0] += rig.lines[:, 6].sum()

    def solved(omega, part):
        """Motions by the solver's coefficients, in part with rows and columns exchanged."""
        added, radiated = (
            CubicSpline(hydro.omega, (1 - part) * each + part * each.swapaxes(1, 2))(omega)
            for each in (hydro.added_mass, hydro.damping)
        )
        stiffness = hydro.stiffness + rig.mooring_stiffness
        dynamic = stiffness - omega**2 * (hydro.mass + added) - 1j * omega * (radiated + damping)
        return np.linalg.solve(dynamic, excitation_at(hydro, [omega])[0])

    found = []
    for ratio, motion in ((1.5, 1), (1.0, 0)):  # heave, surge
        omega = wavelength_to_frequency(1.4 * ratio, 3.6)
        own, turned, even = (solved(omega, part)[motion] for part in (0.0, 1.0, 0.5))
        ours = linear_response(rig, np.array([omega]), damping)[0, motion]
        pairs = (ours, own), (turned, own), (ours, even)
        found.append([100 * abs(a / b - 1) for a, b in pairs])
    said = TANK[TANK.index("**Where the solver is weakest.**") :]
    said = " ".join(said[: said.index("A mesh of twice")].split())
    quoted = re.findall(r"([\d.]+) % and ([\d.]+) %", said)
    assert len(quoted) == 3
    for heave, surge, texts in zip(*found, quoted, strict=True):
        for value, text in zip((heave, surge), texts, strict=True):
            # As printed; another linear algebra moves the tenth digit.
            assert value == pytest.approx(float(text), abs=0.051), said
