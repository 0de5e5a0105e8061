"""What `benchmarks/tank_figures.py` prints and draws."""

import numpy as np
import pandas as pd
import pytest
from tank_figures import comparison, main, matrix_rows, realise, realised_tables

from seakeep.tank.play import play_run

pytest.importorskip("numba", reason="needs the extra tank")

pytest.importorskip("matplotlib", reason="needs the extra figures")


@pytest.fixture(scope="module")
def realised(settings, rig):
    return [realise(play_run(settings, name, rig), name) for name in settings.runs]


def test_default_seed_realises_the_papers_waves(settings, realised):
    table = comparison(settings, realised)
    stated = {
        "significant height": (0.16, 0.01),
        "zero-up-crossing period": (1.64, 0.05),
        "peak period (paper's Welch)": (1.98, 0.15),
        "height, wavelength 2.10 m": (0.105, 0.01),
        "height, wavelength 2.80 m": (0.107, 0.01),
        "height, wavelength 4.20 m": (0.116, 0.01),
    }
    assert list(table.index) == list(stated)
    for name, (paper, tolerance) in stated.items():
        assert table.here[name] == pytest.approx(paper, abs=tolerance)


def test_motions_and_slack_of_the_page(realised):
    for run in realised[:3]:
        mean, spread, slack = (run.motions[each] for each in ("mean", "SD", "slack"))
        # Slow surge is a handful of swings per run.
        assert spread["heave"] == pytest.approx(0.032, abs=0.003)
        assert np.rad2deg(spread["pitch"]) == pytest.approx(2.9, abs=0.2)
        assert spread["surge_fast"] == pytest.approx(0.033, abs=0.003)
        assert mean["surge"] == pytest.approx(0.38, abs=0.05)
        assert mean["mooring_bow"] == pytest.approx(1.8, abs=0.2)
        assert slack["mooring_bow"] == 0.0
    slack = {run.run: run.motions.slack["mooring_stern"] for run in realised}
    assert 0.01 < max(slack[run.run] for run in realised[:3]) < 0.2  # at times
    assert 0.6 < slack["regular_1_5"] < 1.0  # mostly


def test_test_matrix_is_the_papers_first_table(settings, realised):
    rows = matrix_rows(settings, realised)
    assert [row["runs"] for row in rows] == ["3", "1", "1", "1"]
    assert [row["λ/L"] for row in rows] == ["Pierson–Moskowitz spectrum", "1.5", "2", "3"]
    assert [row["h [m]"] for row in rows] == ["0.15", "0.10", "0.10", "0.10"]
    phase = [float(row["phase speed [m/s]"]) for row in rows[1:]]
    group = [float(row["group speed [m/s]"]) for row in rows[1:]]
    # One in the last digit of the paper's table.
    assert phase == pytest.approx([1.811, 2.090, 2.560], abs=1.5e-3)
    assert group == pytest.approx([0.905, 1.045, 1.280], abs=1.5e-3)
    assert rows[1]["realised h [m]"].startswith("0.105 ± 0.00")


def test_tables_state_units_and_verdicts(settings, realised):
    _, waves, true = realised_tables(settings, realised)
    cells = {row[0]: row[1:] for row in waves.rows}
    assert cells["zero-up-crossing period"][0] == "s"
    assert cells["significant height"][0] == "m"
    assert {row[-1] for row in waves.rows} == {"within"}
    units = {channel: unit for _, channel, unit, *_ in true.rows}
    assert units["surge_fast"] == units["piston"] == "m"
    assert units["pitch"] == "rad"
    assert units["mooring_bow"] == "N"
    slack = {(run, channel): share for run, channel, *_, share in true.rows}
    assert 60 < float(slack["regular_1_5", "mooring_stern"]) < 100  # percent, mostly
    assert slack["regular_1_5", "heave"] == ""


def test_the_script_prints_tables_and_draws_figures(tmp_path, capsys):
    short = tmp_path / "short.toml"
    short.write_text(
        "[runs.sea]\nstartup = 5.0\nduration = 30.0\n"
        "spectrum = { height = 0.15, peak_period = 2.0 }\n"
        "[runs.regular]\nstartup = 5.0\nduration = 20.0\nwavelength = 2.8\nheight = 0.1\n",
        encoding="utf-8",
    )
    out = tmp_path / "out"
    main([str(short), "--out", str(out), "--seed", "3", "--run", "sea"])
    printed = capsys.readouterr().out
    for text in ("Test matrix", "Realised waves", "significant height", "Pierson", "True motions"):
        assert text in printed
    figures = list(out.glob("*.png"))
    assert {p.name for p in figures} == {"hydrodynamics.png", "spectrum.png", "run_sea.png"}
    assert all(p.stat().st_size > 10_000 for p in figures)
    assert set(pd.read_csv(out / "truth.csv")["run"]) == {"sea"}
