"""From files to analysis-ready runs."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from said import data_error, request_error, warned
from small_tank import DT, tank_columns, write_csv

from seakeep import DataError, RequestError
from seakeep.campaign import load_prepared, read_campaign, write_prepared
from seakeep.files import write_netcdf
from seakeep.signals import (
    band_pass,
    differentiate,
    encounter_period,
    envelope_squared,
    integrate,
    low_pass,
    resample,
)


@pytest.fixture
def campaign(changed):
    return changed()


def test_raw_run_is_in_si_units(campaign):
    run, raw = campaign.read_run("first"), tank_columns(0)
    assert_array_equal(run["time"], raw["Time [s]"])
    # One product with a rounded factor.
    assert_allclose(run["heave"], 1e-3 * raw["Heave [mm]"], rtol=1e-15)
    assert_allclose(run["pitch"], np.deg2rad(raw["Pitch (deg)"]), rtol=1e-14)
    assert_allclose(run["acc"], 9.80665 * raw["acc [g]"], rtol=1e-15)
    assert {str(n): each.attrs["units"] for n, each in run.items()} == {
        "eta_fwd": "m", "heave": "m", "pitch": "rad", "acc": "m/s^2", "pitch_rate": "rad/s",
    }  # fmt: skip
    assert run["acc"].attrs["long_name"] == "acceleration of the bow"
    assert run["eta_fwd"].attrs["x_position"] == -2.5
    assert "x_position" not in run["heave"].attrs


def test_offset_is_added_in_the_files_unit_before_the_sign(changed):
    stated = 'column = "Heave"\nsign = -1\noffset = 250\naccuracy = 0.5'
    run = changed(('column = "Heave"', stated)).read_run("first")
    # heave = -(reading + 250 mm)
    expected = -(tank_columns(0)["Heave [mm]"] + 250) * 1e-3
    assert_allclose(run["heave"], expected, rtol=1e-15)  # order of two products
    assert run["heave"].attrs["accuracy"] == pytest.approx(0.5e-3)  # mm
    assert "accuracy" not in run["eta_fwd"].attrs


@pytest.mark.parametrize("number", [-999.9, 0])  # times begin at zero
def test_a_number_for_no_reading_is_a_gap_of_channels_alone(changed, tank, number):
    columns = tank_columns(0)
    columns["Heave [mm]"][7:9] = number, np.float32(number)
    write_csv(tank / "first.csv", columns)
    campaign = changed(("[rig]", f"[files]\nmissing = {number}\n\n[rig]"))
    with data_error(r"'heave' has 2 missing values .* first at t = 0\.14 s"):
        campaign.read_run("first")


def test_parameters_of_a_run_are_its_attributes(changed):
    stated = "span = [2, 18]\nparameters = { draught = 0.083, water_depth = 3.0 }"
    runs = changed(("span = [2, 18]", stated)).prepare()
    assert (runs["second"].attrs["draught"], runs["second"].attrs["water_depth"]) == (0.083, 3.0)
    assert "draught" not in runs["first"].attrs


def test_prepared_runs(campaign):
    calls = []
    runs = campaign.prepare(progress=lambda *call: calls.append(call))
    assert calls == [(1, 2, "first"), (2, 2, "second")]
    first, second = runs["first"], runs["second"]
    assert_allclose(first["time"], np.arange(201) * 0.1, rtol=1e-15)
    assert_allclose(second["time"], 2 + np.arange(161) * 0.1, rtol=1e-15)
    expected = {
        "run": "first",
        "role": "train and test",
        "sea_state": "moderate",
        "water_depth": 3.6,
        "scale_factor": 30.0,
        "train_span": (0.0, 10.0),
        "test_span": (10.0, 20.0),
        "campaign_digest": campaign.digest,
        "file": "first.csv",
    }
    assert {key: first.attrs[key] for key in expected} == expected
    assert "encounter_period" not in first.attrs
    assert second.attrs["test_span"] == (2.0, 18.0)
    assert "train_span" not in second.attrs
    assert first["pitch_rate"].attrs["derived_from"] == "pitch, differentiated"


def test_each_file_is_parsed_once(changed, monkeypatch):
    """Although the encounter period is measured on all runs before the first is prepared."""
    parsed, read_csv = [], pd.read_csv
    monkeypatch.setattr(pd, "read_csv", lambda *a, **k: parsed.append(1) or read_csv(*a, **k))
    assert len(changed(("sampling_rate = 10", "steps_per_period = 32")).prepare()) == 2
    assert len(parsed) == 2


def test_the_whole_record_is_resampled_and_then_cut(campaign):
    raw = campaign.read_run("second")
    whole = resample(raw["pitch_rate"], raw["time"], np.arange(201) * 0.1)
    # Channels side by side are summed in another order.
    assert_near(campaign.prepare(["second"])["second"]["pitch_rate"], whole[20:181], 1e-14)


def test_derived_at_the_files_own_rate(changed):
    run = changed(
        (
            "[runs.first]",
            '[derived.speed]\nfrom = "acc"\nstep = "integrate"\nband = [0.3, 5]\n'
            '[derived.way]\nfrom = "acc"\nstep = "integrate"\nband = [0.3, 5]\ntimes = 2\n'
            'unit = "mm"\nlong_name = "way of the bow"\n'
            '[derived.smooth]\nfrom = "twice"\nstep = "low_pass"\npassband = 1\n'
            '[derived.twice]\nexpression = "2 * eta_fwd"\nunit = "m"\n'
            '[derived.waves]\nfrom = "pitch"\nstep = "band_pass"\nband = [0.3, 5]\n'
            '[derived.group]\nfrom = "eta_fwd"\nstep = "envelope_squared"\n'
            '[derived.sway]\nexpression = "1000 * pitch"\nunit = "mm"\n[runs.first]',
        )
    ).read_run("first")
    acc, eta = run["acc"].to_numpy(), run["eta_fwd"].to_numpy()
    assert_array_equal(run["speed"], integrate(acc, DT, (0.3, 5.0)))
    assert_array_equal(run["way"], integrate(acc, DT, (0.3, 5.0), 2))
    assert_array_equal(run["twice"], 2 * eta)
    assert_array_equal(run["smooth"], low_pass(2 * eta, DT, 1.0))
    assert_array_equal(run["waves"], band_pass(run["pitch"], DT, (0.3, 5.0)))
    assert run["waves"].attrs["units"] == "rad"
    assert_array_equal(run["group"], envelope_squared(eta, DT))
    assert_array_equal(run["pitch_rate"], differentiate(run["pitch"], DT))
    # 'unit' is that of the expression's value: millimetres, kept as metres.
    assert_allclose(run["sway"], run["pitch"], rtol=1e-15)
    units = {n: run[n].attrs["units"] for n in ("speed", "way", "smooth", "group", "sway")}
    assert units == {"speed": "m/s", "way": "m", "smooth": "m", "group": "m^2", "sway": "m"}
    assert run["way"].attrs["long_name"] == "way of the bow"


def test_an_expression_of_radians_is_not_in_degrees(changed):
    # Converted from degrees it would be 57 times too small.
    table = '[derived.trim]\nexpression = "pitch - mean(pitch)"\nunit = "deg"\n[runs.first]'
    with request_error(r"some in 'rad', .* State unit = 'rad'"):
        changed(("[runs.first]", table)).read_run("first")


@pytest.mark.parametrize(("rate", "dt"), [("dt = 0.13", 0.13), ("steps_per_period = 32", 0.05)])
def test_the_step_is_the_stated_one(changed, rate, dt):
    period = ("scale_factor = 30.0", "encounter_period = 1.6")
    campaign = changed(("sampling_rate = 10", rate), period)
    assert campaign.encounter_period() == 1.6
    for run in campaign.prepare().values():
        assert (run.attrs["dt"], run.attrs["encounter_period"]) == (dt, 1.6)
        assert_allclose(np.diff(run["time"]), dt, rtol=1e-12)


def test_times_in_another_unit_are_refused_before_a_thousand_samples_are_made_of_one(changed, tank):
    columns = tank_columns(1)
    write_csv(tank / "second.csv", columns | {"Time [s]": 1000 * columns["Time [s]"]})
    failed = {}
    assert [name for name, _ in changed().each_prepared(None, None, failed)] == ["first"]
    assert "'second' has 0.05 samples per second by its times, and [preparation] asks for 10. " in (
        str(failed["second"])
    )
    assert changed(("sampling_rate = 10", "sampling_rate = 400")).prepare(["first"])


def test_steps_of_files_that_differ_are_refused(changed, tank):
    write_csv(tank / "second.csv", {name: each[::2] for name, each in tank_columns(1).items()})
    with request_error(
        r"the runs differ in rate: 'first' has a step of 0\.02 s and 'second' one of "
        r"0\.04 s\. State sampling_rate"
    ):
        changed(("sampling_rate = 10", "")).prepare()


def test_the_period_is_the_mean_of_the_irregular_runs(changed):
    both = changed().encounter_period()
    first = changed(('sea_state = "moderate"', 'waves = "irregular"')).encounter_period()
    second = changed(
        ('sea_state = "moderate"', 'waves = "regular"'),
        ('role = "test"', 'role = "test"\nwaves = "irregular"'),
    ).encounter_period()
    assert first != second
    assert_allclose(both, (first + second) / 2, rtol=1e-15)  # rounding of a sum


def test_still_water_before_the_waves_does_not_count(tank, changed):
    # Spans do not cut it off, and the probe's noise crosses the mean all the while.
    columns = tank_columns(0, seconds=60.0)
    waves = columns["WP fwd [mm]"][1250:]
    columns["WP fwd [mm]"][:1250] = 0.05 * np.random.default_rng(0).standard_normal(1250)
    write_csv(tank / "first.csv", columns)
    roles = [
        ("train = [0, 10]\ntest = [10, inf]", 'role = "train"'),
        ('role = "test"\nspan = [2, 18]', 'role = "unused"'),
    ]
    found = changed(*roles).encounter_period()
    # A wave or two of 25 may fall to the still part.
    assert_allclose(found, encounter_period(waves, DT), rtol=0.02)
    campaign = changed(*roles, ("[campaign]", "[campaign]\nperiod_hysteresis = 0.9"))
    # Only waves that pass 0.9 of a deviation on either side are counted: fewer, so longer.
    with warned(r"counts waves of 3\.\d+ s, and the energy period"):
        assert campaign.encounter_period() > 1.1 * encounter_period(waves, DT)


def test_a_period_needs_a_wave_channel(changed):
    campaign = changed(
        ('inputs = ["eta_fwd"]', ""),
        ("[channels.eta_fwd]", "[channels.probe]"),
        ("eta_fwd = -2.5", ""),
    )
    with request_error(r"no wave channel to take the encounter period from. State encounter"):
        campaign.encounter_period()


def test_still_water_has_no_period(tank, campaign):
    for name in ("first.csv", "second.csv"):
        write_csv(tank / name, tank_columns() | {"WP fwd [mm]": 0.0})
    with data_error("run 'first', channel 'eta_fwd': the record of 20"):
        campaign.encounter_period()
    # A constant channel is kept all the same: whether it serves is the model's business.
    assert campaign.prepare(["first"])["first"]["eta_fwd"].std() == 0.0


def gapped(columns):
    heave, pitch = columns["Heave [mm]"].copy(), columns["Pitch (deg)"].copy()
    heave[[100, 101, 102, 300]] = pitch[5] = np.nan
    return columns | {"Heave [mm]": heave, "Pitch (deg)": pitch}


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (
            gapped,
            DataError,
            r"run 'second' .*: channel 'heave' has 4 missing values of 1001 in 2 gap\(s\), the "
            r"first at t = 2 s \(3 samples, 0\.06 s\), the longest at t = 2 s \(3 samples, "
            r"0\.06 s\) \(also in pitch\)\. Repair the file, leave the channel out, or cut the "
            r"gap off with record = \[start, end\] in \[runs\.second\]",
        ),
        (
            lambda columns: columns | {"Time [s]": columns["Time [s]"] ** 1.1},
            DataError,
            r"the times of run 'second' \(.*second\.csv\) are not uniform: steps r",
        ),
        (
            lambda columns: columns | {"Heave [deg]": columns.pop("Heave [mm]")},
            RequestError,
            r"the unit 'deg' does not fit channel 'heave' \(column 'Heave' of .*second\.csv\), "
            "which is measured in 'm'",
        ),
    ],
)
def test_a_file_at_fault(campaign, tank, change, error, message):
    write_csv(tank / "second.csv", change(tank_columns(1)))
    with pytest.raises(error, match=message):
        campaign.prepare()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            'column = "Heave"',
            'column = "Heaves"',
            r"first\.csv has no column 'Heaves'\. Did you mean 'Heave'\? Its columns: Time",
        ),
        *(
            (
                "span = [2, 18]",
                f"{key} = {span}",
                rf"runs\.second\.{key}: received \[.*\] s, and the record runs from 0 to "
                r"20 s\.",
            )
            for key in ("span", "record")
            for span in ("[2, 30]", "[-3, 10]", "[30, 40]")
        ),
        *(
            ("span = [2, 18]", span, rf"holds 0 sample\(s\) at a step of {step} s\. Lengthen")
            for span, step in (("span = [2.01, 2.05]", 0.1), ("record = [2.001, 2.01]", 0.02))
        ),
        ("sampling_rate = 10", "dt = 50", r"of 20 s is shorter than two steps of 50 s"),
        (
            'file = "second.csv"',
            'file = "${TANK_FILES}/second.csv"',
            r"needs the environment variable TANK_FILES, which is not set\. Set it to the "
            r"folder of the data: export TANK_FILES=",
        ),
    ],
)
def test_a_campaign_at_fault(changed, old, new, message):
    with request_error(message):
        changed((old, new)).prepare()


def test_a_gap_is_cut_off(tank, changed):
    columns = tank_columns(1)
    columns["Heave [mm]"][20:30] = np.nan
    write_csv(tank / "second.csv", columns)
    assert changed(("span = [2, 18]", "record = [1, inf]")).prepare()["second"]["time"][0] == 1.0


def test_a_variable_in_a_path(edited, monkeypatch):
    path = edited(('file = "second.csv"', 'file = "${TANK_FILES}/second.csv"'))
    with request_error(r"has no run 'secnd'\. Did you mean 'second'"):
        read_campaign(path).prepare(["secnd"])
    monkeypatch.setenv("TANK_FILES", str(path.parent))
    assert read_campaign(path).prepare(["second"])


def test_the_digest_follows_what_prepared_runs_depend_on(changed):
    def digest(*pair):
        return changed(pair).digest

    same = {
        digest("ridge = 1", "ridge = 2"),
        digest('name = "Small tank"', 'name = "Other"\ndescription = "words"'),
        digest("[rig]", "# a remark\n[rig]"),
    }
    others = {
        digest("sampling_rate = 10", "sampling_rate = 11"),
        digest("span = [2, 18]", "span = [2, 17]"),
        digest('column = "Heave"', 'column = "Heave"\nsign = -1'),
        digest("water_depth = 3.6", "water_depth = inf"),
    }
    assert (len(same), len(others), len(same | others)) == (1, 4, 5)


def test_interrupted_half_way_a_second_call_continues(campaign, tank):
    def stop(done, total, name):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_prepared(campaign, progress=stop)
    # Each run is written before the next one is begun, and nothing half done stays.
    (written,) = (tank / "prepared").iterdir()
    before, calls = written.stat().st_mtime_ns, []
    write_prepared(campaign, progress=lambda *call: calls.append(call))
    assert (written.name, written.stat().st_mtime_ns) == ("first.nc", before)
    assert calls == [(2, 2, "second")]


@pytest.mark.parametrize("change", ["settings", "file", "version", "name"])
def test_stale_files_are_not_used(campaign, tank, changed, change, monkeypatch):
    path = write_prepared(campaign)["second"]
    run = xr.load_dataset(path)
    run["heave"][:] = 0.0  # to be seen if it were used
    write_netcdf(path, run)
    assert load_prepared(campaign)["second"]["heave"].std() == 0.0
    if change == "settings":
        campaign = changed(("sampling_rate = 10", "sampling_rate = 12"))
    elif change == "name":
        campaign = changed(("Small tank", "Smaller tank"))
    elif change == "file":
        write_csv(tank / "second.csv", tank_columns(5))
    else:
        monkeypatch.setattr("seakeep.campaign.prepare.version", lambda: "99.0")
    assert load_prepared(campaign)["second"]["heave"].std() > 0.0


def test_a_measurement_is_never_overwritten(tank, changed):
    """`prepare -o .` replaced the raw run1.nc by the prepared run of that name."""
    campaign = changed(('file = "first.csv"', 'file = "first.nc"'))
    (tank / "other").mkdir()
    for folder, message in (
        (tank, r"first\.nc is read by this command and would be"),
        (tank / "other", r"first\.nc exists and is not a prepared run that"),
    ):
        (folder / "first.nc").write_bytes(b"CDF")
        with request_error(message):
            write_prepared(campaign, folder, ["first"])
        assert (folder / "first.nc").read_bytes() == b"CDF"


def test_a_file_that_was_cut_off_is_made_anew(campaign):
    path = write_prepared(campaign, names=["second"])["second"]
    (expected,) = load_prepared(campaign, names=["second"]).values()
    path.write_bytes(path.read_bytes()[:-1])
    with warned(r"second\.nc was cut off, altered"):
        (run,) = load_prepared(campaign, names=["second"]).values()
    xr.testing.assert_identical(run, expected)


def test_a_span_to_the_end_of_the_record(tank, first):
    """60 s at 50 Hz end at 59.98 s: the last sample stands for its own step."""
    write_csv(tank / "first.csv", {name: x[:-1] for name, x in tank_columns(0).items()})
    for rate in ("10", "50", "200"):
        chain = "sampling_rate = 10", f"sampling_rate = {rate}"
        run = first(("test = [10, inf]", "test = [10, 20]"), chain)
        assert run.attrs["test_span"][1] == pytest.approx(float(run["time"][-1]))
    with request_error(r"first\.test: received \[10, 20\.1\] s, and"):
        first(("test = [10, inf]", "test = [10, 20.1]"))
