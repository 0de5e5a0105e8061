"""Raw samples in service: the chain on a window that moves gives what it gives offline."""

import numpy as np
import pytest
import two_loggers
import xarray as xr
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from said import request_error
from tutorial_study import TUTORIAL

import seakeep
from seakeep.formats import read_columns


@pytest.fixture(scope="module")
def campaign():
    return seakeep.read_campaign(TUTORIAL / "campaign.toml")


@pytest.fixture(scope="module")
def rows():
    """The raw file, as a logger would send it."""
    return read_columns(TUTORIAL / "run3.csv").values


def between(rows, first, stop):
    """Rows of a part of the time, which is their first column."""
    part = slice(*np.searchsorted(next(iter(rows.values())), [first, stop]))
    return {name: each[part] for name, each in rows.items()}


def chain_of(campaign, **changes):
    return campaign.live_chain("unseen", **{"delay": "1 T", "window": "20 T"} | changes)


def sent(chain, rows, stop=60.0, step=4.0):
    """What the chain gives of the rows up to an instant, sent a few seconds at a time."""
    given = [chain.push({"": between(rows, at, at + step)}) for at in np.arange(0, stop, step)]
    return xr.concat([each for each in given if each.sizes["time"]], "time")


def test_it_gives_what_preparation_gives_but_for_the_ends_of_its_window(campaign, rows):
    offline, errors = campaign.prepare(["unseen"])["unseen"], {}
    for delay in ("0.1 T", "1 T"):
        found = sent(chain_of(campaign, delay=delay), rows)
        time = found["time"].values
        assert_allclose(np.diff(time), offline.attrs["dt"], rtol=1e-9)
        expected = offline.sel(time=time, method="nearest")
        assert_near(expected["time"], time, 1e-9)
        assert time[-1] <= 60.0 - campaign.seconds(delay)
        errors[delay] = {
            name: float(np.std(found[name].values - expected[name].values) / expected[name].std())
            for name in offline.data_vars
        }
    # Filters look both ways: what follows a sample within a period decides most of it.
    assert max(errors["1 T"].values()) < 0.02
    assert np.mean(list(errors["1 T"].values())) < np.mean(list(errors["0.1 T"].values()))


def test_how_rows_are_cut_up_does_not_matter(campaign, rows):
    one, whole = (chain_of(campaign, window="60 T", every=8) for _ in range(2))
    small = sent(one, rows, 30.0, 0.5)
    large = whole.push({"": between(rows, 0, 30)})
    assert small["time"].values[0] == large["time"].values[0]
    assert abs(small.sizes["time"] - large.sizes["time"]) < 8
    assert whole.push({}).sizes["time"] == 0


def test_a_chain_that_was_saved_goes_on_to_the_last_bit(campaign, rows, tmp_path):
    whole, again, late = (chain_of(campaign) for _ in range(3))
    whole.push({"": between(rows, 0, 30)})
    again.resume(whole.save(tmp_path / "chain.nc"))
    for first in (30, 34, 38):
        part = {"": between(rows, first, first + 4)}
        xr.testing.assert_identical(again.push(part), whole.push(part))
    late.resume(late.save(tmp_path / "chain.nc"))  # before the first row
    assert late.push({"": between(rows, 0, 10)}).sizes["time"] > 0
    rig = seakeep.read_campaign(two_loggers.write(tmp_path))
    other = rig.live_chain("one", delay=2.0, window=20.0)
    with request_error("a chain with other loggers, columns or steps"):
        whole.resume(other.save(tmp_path / "other.nc"))


def test_a_gap_is_masked_and_what_follows_it_is_as_if_there_were_none(campaign, rows):
    assert campaign.settings.preparation.gaps == "refuse"
    time = rows["t"]
    kept = (time < 20.0) | (time > 23.0)
    gapped = {name: each[kept] for name, each in rows.items()}
    found, whole = (sent(chain_of(campaign), each) for each in (gapped, rows))
    assert_array_equal(found["time"], whole["time"])
    assert found["heave"].isel(time=(found["time"] > 20.1) & (found["time"] < 22.9)).isnull().all()
    after = found["time"] > 40.0
    for name in ("heave", "eta_fwd"):
        left = (found[name] - whole[name]).isel(time=after).std() / whole[name].std()
        assert left < 1e-3  # the memory of filters fades within some periods


def test_seconds_of_day_go_on_counting_over_each_midnight(campaign, rows):
    counted = rows["t"] + 2 * 86400.0 - 30.0
    of_day, near = counted % 86400.0, [slice(740, 750), slice(750, 751), slice(751, 765)]
    for told, midnight in (
        (np.where(rows["t"] < 20.0, counted, of_day), near),
        (of_day, near),
        (of_day, []),  # its rows are lost
    ):
        whole, fallen = chain_of(campaign), chain_of(campaign)
        for part in (
            slice(0, 500),
            slice(500, 740),
            *midnight,
            slice(765, 1000),
            slice(1000, 1500),
        ):
            sent = {name: each[part] for name, each in rows.items()}
            expected = whole.push({"": sent | {"t": counted[part] - counted[0] + told[0]}})
            xr.testing.assert_identical(fallen.push({"": sent | {"t": told[part]}}), expected)
        with request_error("do not increase.*Send each row once"):
            fallen.push({"": sent | {"t": told[part]}})


def test_a_silent_logger_is_named_before_the_rows_of_others_pile_up(tmp_path):
    path = two_loggers.write(tmp_path)
    chain = seakeep.read_campaign(path).live_chain("one", delay=2.0, window=20.0)
    rows = {key: read_columns(tmp_path / f"one_{key}.csv").values for key in ("probes", "mru")}

    for first in range(0, 36, 4):
        sending = rows if first < 20 else ["probes"]
        chain.push({key: between(rows[key], first, first + 4) for key in sending})
    size = len(chain._rows["probes"]["p1"])
    with request_error(r"'mru' has sent nothing for .* NaN in its columns"):
        chain.push({"probes": between(rows["probes"], 36, 48)})
    assert len(chain._rows["probes"]["p1"]) == size  # nothing was taken
    lost = {
        name: each if name == "t" else np.full(len(each), np.nan)
        for name, each in between(rows["mru"], 20, 48).items()
    }
    found = chain.push({"probes": between(rows["probes"], 36, 48), "mru": lost})
    assert found["eta_fwd"].sel(time=slice(25.0, 40.0)).notnull().all()
    assert found["heave"].sel(time=slice(25.0, 40.0)).isnull().all()
