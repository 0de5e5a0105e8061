"""Lengths and frequencies in encounter periods, through a whole campaign file."""

import numpy as np
import pytest
import xarray as xr
from said import request_error
from small_tank import tank_columns, write_csv
from tutorial_study import edit

from seakeep import read_campaign
from seakeep.models.settings import periods_to_samples
from seakeep.study import fit_campaign

STATED = ("scale_factor = 30.0", "encounter_period = 1.6")


def test_all_lengths_of_a_campaign(edited):
    """The same campaign in seconds and in periods gives the same runs."""
    redundant = "[redundant.motion]\nchannels = ['heave', 'eta_fwd']\nwindow = 4\n[preparation]"
    record = "span = [3.2, 16]\nrecord = [1.6, 19.2]"
    path = edited(STATED, ("[preparation]", redundant), ("span = [2, 18]", record))
    seconds = read_campaign(path)
    edit(
        path,
        ("train = [0, 10]", "train = ['0 T', '6.25 T']"),
        ("test = [10, inf]", "test = ['6.25 T', inf]"),
        ("span = [3.2, 16]", "span = ['2 T', 16]"),
        ("record = [1.6, 19.2]", "record = ['1 T', '12 T']"),
        ("window = 4", "window = '2.5 T'"),
    )
    periods = read_campaign(path)
    assert periods.digest != seconds.digest
    expected, found = seconds.prepare(), periods.prepare()
    assert list(found) == list(expected)
    for name, run in found.items():
        same = run.assign_attrs(campaign_digest=seconds.digest)
        xr.testing.assert_identical(same, expected[name])
    assert periods.seconds("2.5 T") == 4.0
    assert periods.seconds(2.5) == 2.5


def test_spans_of_regular_runs_count_in_the_period_that_irregular_ones_give(changed):
    campaign = changed(
        ("train = [0, 10]", 'waves = "irregular"\ntrain = [0, 10]'),
        ("span = [2, 18]", 'waves = "regular"\nspan = ["1 T", "7.5 T"]'),
    )
    period = campaign.encounter_period()
    run = campaign.prepare(["second"])["second"]
    # The first and the last instant of a grid of 0.1 s inside the span.
    assert 0 <= float(run["time"][0]) - period < 0.1
    assert 0 <= 7.5 * period - float(run["time"][-1]) < 0.1
    assert run.attrs["encounter_period"] == period


@pytest.mark.parametrize("key", ["record", "span", "train", "test"])
@pytest.mark.parametrize("use", [lambda c: c.read_run("first"), lambda c: c.prepare(["first"])])
def test_a_span_that_runs_backwards_in_any_run_stops_all(changed, key, use):
    """With the measured period of some 1.4 s, and with a stated one at once."""
    irregular = "train = [0, 10]", "waves = 'irregular'\ntrain = [0, 10]"
    backwards = 'role = "test"\nspan = [2, 18]', f"waves = 'regular'\n{key} = [12, '7 T']"
    campaign = changed(irregular, backwards)
    with request_error(rf"^runs\.second\.{key}: received \[12.0, 7 T\]"):
        use(campaign)
    with request_error(r"runs\.second.*with an encounter period of 1\.6 s is "
                                           r"\[12, 11\.2\]"):  # fmt: skip
        changed(STATED, irregular, backwards)


@pytest.mark.parametrize(("waves", "seconds"), [("", 5.0), ("waves = 'still'", 20.0)])
def test_runs_of_few_waves_or_none_have_no_part_in_the_period(tank, changed, waves, seconds):
    """A test of three waves must change neither T̂ nor, with it, the delays of a model."""
    alone = changed(('role = "test"', "role = 'unused'")).encounter_period()
    write_csv(tank / "second.csv", tank_columns(5, seconds))
    assert changed(("span = [2, 18]", waves)).encounter_period() == alone


@pytest.mark.parametrize("measured", [False, True])
def test_delays_window_and_stop_of_a_model(edited, measured):
    pairs = [] if measured else [STATED]
    keys = "state_delays = 4\ninput_delays = 8\nridge = 1\n"
    path = edited(*pairs, (keys, 'state_delays = "0.5 T"\ninput_delays = "0.75 T"\nridge = 1\n'
                           'window = "3 T"\nstop = "5 T"\n'))  # fmt: skip
    campaign = read_campaign(path)
    period = campaign.encounter_period()
    s, z, m = (periods_to_samples(n, period, 0.1) for n in (0.5, 0.75, 3))
    model = fit_campaign(campaign)
    found = model.settings
    assert (found.state_delays, found.input_delays, found.window) == (s, z, m)
    path = edited(*pairs, (keys, f"state_delays = {s}\ninput_delays = {z}\nridge = 1\n"
                           f"window = {m}\nstop = {5 * period}\n"))  # fmt: skip
    np.testing.assert_array_equal(model.A, fit_campaign(read_campaign(path)).A)
