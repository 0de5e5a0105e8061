"""The three acts of ``seakeep reproduce``: one tank, the same windows, and a page over them."""

import warnings
from math import tau

import numpy as np
import pytest
import xarray as xr
from tutorial_study import study_of

from seakeep import SeakeepWarning
from seakeep.report.tables import MISSING
from seakeep.study.plan import make_plan
from seakeep.study.reproduce import ACTS, HIGH_PASS, SLOW, Size, reproduce, study_text

pytest.importorskip("seakeep.tank.play")
from seakeep.tank.play import campaign_text, write_record
from seakeep.tank.settings import default_settings

SMALL = Size(training=1, tests=2, members=2, series=4)
RATE = 32.0  # Hz: the band of rates ends at 15 Hz


def record(name, seconds, rng):
    """A made-up run on one logger: linear waves, and a drift in surge and loads."""
    t = np.arange(round(seconds * RATE) + 1) / RATE
    regular = {"regular_1_5": [0.86], "regular_2": [0.75], "regular_3": [0.61]}
    omega = tau * np.array(regular.get(name, [0.4, 0.5, 0.57, 0.66, 0.75, 0.9]))
    turn = omega * t[:, None] + rng.uniform(0, tau, omega.size)

    def waves(amplitude, lag, rate=0):
        return (amplitude * (1j * omega) ** rate * np.exp(1j * (turn - lag))).real.sum(axis=1)

    drift = np.sin(tau * t / 29.9) + 0.3 * np.sin(tau * t / 47.0)
    load = waves(0.1, 2.5) + 0.4 * drift
    made = {
        "kn_fwd": (waves(20.0, 0.0), "mm"),
        "kn_cog": (waves(20.0, omega**2 * 3.67 / 9.81), "mm"),
        "heave": (waves(0.01, 2.0), "m"),
        "pitch": (waves(1.0, 1.0), "deg"),
        "rate_y": (waves(1.0, 1.0, 1), "deg/s"),
        "acceleration_x": (waves(0.008, 2.5, 2), "m/s^2"),
        "acceleration_z": (waves(0.01, 2.0, 2), "m/s^2"),
        "surge": (waves(0.008, 2.5) + 0.25 * drift, "m"),
        "mooring_bow": (2.0 + load, "N"),
        "mooring_stern": (2.0 - load, "N"),
    }
    noisy = {
        name: ("time", x + 0.01 * x.std() * rng.standard_normal(x.size), {"units": unit})
        for name, (x, unit) in made.items()
    }
    return xr.Dataset(noisy, coords={"time": ("time", t, {"units": "s"})})


def play_small(settings, out, executor, progress):
    """Stands in for the tank: six small runs, and the campaign file that the tank would write."""
    for each in ("raw", "truth"):
        (out / each).mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(0)
    files = {}
    for name, run in settings.runs.items():
        made = record(name, run.length, rng)
        files[name] = {name: f"raw/{write_record(made, out / 'raw' / f'{name}.nc').name}"}
        made[["heave"]].to_netcdf(out / "truth" / f"{name}.nc", engine="h5netcdf")
    (out / "campaign.toml").write_text(campaign_text(settings, files, "nc", True), "utf-8")


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """The acts of the paper with the smallest counts."""
    folder = tmp_path_factory.mktemp("reproduction")
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        warnings.simplefilter("ignore", SeakeepWarning)  # of windows that hold one drift cycle
        patch.setattr("seakeep.tank.play.play", play_small)
        return reproduce(folder, "paper", size=SMALL)


def test_what_was_played_and_computed_is_taken_as_it_is(results, monkeypatch):
    played = results["paper"].folder.parent
    monkeypatch.setattr("seakeep.tank.play.play", None)
    told = []
    again = reproduce(played, "paper", size=SMALL, progress=lambda *each: told.append(each[2]))
    assert [words for words in told if words.endswith("finished before")] == [
        f"{act.title}: finished before" for act in ACTS[:2]
    ]
    xr.testing.assert_identical(again["raw"].tests["irregular"], results["raw"].tests["irregular"])


def test_all_acts_have_the_same_windows_and_the_recommended_model_learns_from_other_runs(
    results, tmp_path
):
    folder = results["paper"].folder.parent
    text = study_text(ACTS[2], SMALL, 0).replace("../campaign", str(folder / "campaign"))
    (tmp_path / "study.toml").write_text(text, "utf-8")
    plan = make_plan(study_of(tmp_path))
    for each in plan.training:
        assert not set(each.left_out) & {run for run, *_ in each.spans}
    for name, planned in plan.tests.items():
        windows = [(each.run, each.start) for each in planned]
        for result in results.values():
            data = result.tests[name]
            assert list(zip(data["run"].values, data["start"].values, strict=True)) == windows
    stops = [result.groups["training"]["stop"].values for result in results.values()]
    np.testing.assert_array_equal(*stops)
    # The waves are carried to where the vessel is, drift included.
    aligned = ("deterministic", "bayesian", "fir", "fir_ahead")
    assert results["paper"].conditional_on == dict.fromkeys(aligned, "surge_with_drift")
    assert results["raw"].conditional_on == dict.fromkeys(aligned, "surge")


def test_the_first_act_alone_has_lost_the_drift_and_keeps_the_waves(results):
    for name in SLOW:
        slow, fast = {}, {}
        for act, result in results.items():
            run = result.prepared["irregular_1"][name].values.astype(float)
            spectrum = np.abs(np.fft.rfft((run - run.mean()) * np.hanning(run.size))) ** 2
            frequency = np.fft.rfftfreq(run.size, result.attrs["dt"])
            slow[act] = spectrum[frequency < 0.08].sum()
            fast[act] = spectrum[frequency > 0.3].sum()  # the waves begin at 0.4 Hz
        assert slow["paper"] < 1e-3 * slow["raw"]
        # What differs is noise above the band's upper edge, 9 Hz.
        assert fast["paper"] == pytest.approx(fast["raw"], rel=0.01)


def test_the_table_of_the_acts_is_made_of_their_cells(results):
    from seakeep.report.acts import acts_table

    table = acts_table(results)
    assert len(table.rows) == sum(len(result.models) for result in results.values())
    assert tuple(table.columns[2:6]) == (
        "irregular: waves", "irregular: slow", "λ/L 1.5: waves", "λ/L 1.5: slow"
    )  # fmt: skip
    assert "(b): Conditional on measured surge: deterministic, Bayesian, FIR" in table.note
    data = results["raw"].tests["regular_2"]
    slow = data["error"].sel(model="fir", measure="nrmse", channel=list(SLOW))
    slow = slow.mean("channel").median()
    (row,) = (row for row in table.rows if row[:2] == ("(b)", "FIR"))
    assert row[table.columns.index("λ/L 2: slow")] == f"{float(slow):.2f}"


def test_findings_name_the_models_that_know_more(results):
    from seakeep.report.sections.results import findings

    said = findings(results["raw"])
    begins = ("Conditional on measured surge: deterministic, ", "Models read the waves ahead of ")
    assert [sum(each.startswith(words) for each in said) for words in begins] == [1, 1]


def test_every_claim_has_a_figure_and_a_verdict(results):
    from seakeep.report.acts import claims_table

    table = claims_table(results)
    assert len({row[0] for row in table.rows}) == 20
    assert {row[2] for row in table.rows} <= {"holds", "does not", "cannot tell"}
    assert not [row for row in table.rows if "nan" in row[1] or MISSING in row[1]]


def test_the_edge_of_the_drift_lies_between_drift_and_waves():
    slowest = default_settings().runs["irregular_1"].spectrum.band[0]
    # A filter of 60 s bends within some tenths of its edge; the drift is at 0.03 Hz.
    assert 4 * 0.03 < HIGH_PASS < slowest / 1.5
