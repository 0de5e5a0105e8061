"""TDMS files, written by nptdms."""

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from said import request_error

from seakeep.campaign import read_table
from seakeep.campaign.settings import FileSettings

nptdms = pytest.importorskip("nptdms")

STEP = 0.05
T = np.arange(200) * STEP
HEAVE, WAVE = np.sin(T), np.cos(T)
WAVEFORM = {"wf_increment": STEP, "wf_start_offset": 2.5, "unit_string": "mm"}


def channel(name, values, group="run", **properties):
    return nptdms.ChannelObject(group, name, values, properties=properties)


@pytest.fixture
def read(tmp_path):
    """Read channels from a file, by stated settings."""

    def table(*channels, **stated):
        with nptdms.TdmsWriter(tmp_path / "run.tdms") as writer:
            writer.write_segment([nptdms.RootObject(), *channels])
        return read_table(tmp_path / "run.tdms", FileSettings(**stated))

    return table


def test_waveforms(read):
    run = read(
        channel("heave", HEAVE, **WAVEFORM),
        channel("wave", WAVE, **{**WAVEFORM, "unit_string": "m"}),
    )
    # The file holds a step, not times: both are its multiples up to rounding.
    assert_allclose(run["time"], 2.5 + T, rtol=1e-15)
    assert_array_equal(run["heave"], HEAVE)
    assert set(run.data_vars) == {"heave", "wave"}
    assert (run["heave"].attrs["units"], run["wave"].attrs["units"]) == ("mm", "m")


def test_a_time_channel_and_integers(read):
    run = read(
        channel("Time", 1e3 * T, unit_string="ms"),
        channel("count", np.arange(200, dtype=np.int16)),
        channel("remark", ["x"] * 200),
    )
    assert_allclose(run["time"], T, rtol=1e-12)
    assert_array_equal(run["count"], np.arange(200.0))
    assert set(run.data_vars) == {"count"}


def test_time_stamps_count_from_the_first(read):
    start = np.datetime64("2024-05-06T07:08:09.000000")
    stamps = start + (1e6 * T).round().astype("timedelta64[us]")
    run = read(channel("Time", stamps), channel("heave", HEAVE))
    assert_near(run["time"], T, 1e-6)  # they are written in microseconds


def test_scaled_channels(read):
    """Counts with a linear scale in the properties are read in the scale's unit."""
    scale = {
        "NI_Number_Of_Scales": 1,
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.5,
        "NI_Scale[0]_Linear_Y_Intercept": 10.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
        "wf_increment": STEP,
    }
    run = read(channel("load", np.arange(200, dtype=np.int32), **scale))
    assert_array_equal(run["load"], 10 + 0.5 * np.arange(200))


def test_groups(read):
    loads = channel("load", np.arange(2000.0), "loads", wf_increment=0.005)
    both = channel("heave", HEAVE, **WAVEFORM), loads
    with request_error(
        r"several groups that are sampled differently: 'loads' \(1 channels of 2000\), 'run' "
        r"\(1 channels of 200\)\. State which one with group = 'NAME' in .*--group NAME to"
    ):
        read(*both)
    assert read(*both, group="loads").sizes["time"] == 2000
    with request_error(r"no group 'load'\. Did you mean 'loads'\? Its groups"):
        read(*both, group="load")
