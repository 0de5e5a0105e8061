"""TDMS files, written by nptdms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from seakeep.campaign import read_table
from seakeep.campaign.settings import FileSettings
from seakeep.errors import RequestError

nptdms = pytest.importorskip("nptdms")

STEP = 0.05
T = np.arange(200) * STEP
HEAVE, WAVE = np.sin(T), np.cos(T)
WAVEFORM = {"wf_increment": STEP, "wf_start_offset": 2.5, "unit_string": "mm"}


def channel(name, values, group="run", **properties):
    return nptdms.ChannelObject(group, name, values, properties=properties)


def save(folder, *channels):
    path = folder / "run.tdms"
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.RootObject(), *channels])
    return path


def test_waveforms(tmp_path):
    path = save(
        tmp_path,
        channel("heave", HEAVE, **WAVEFORM),
        channel("wave", WAVE, **{**WAVEFORM, "unit_string": "m"}),
    )
    run = read_table(path)
    # The file holds a step, not times: both are its multiples up to rounding.
    assert_allclose(run["time"], 2.5 + T, rtol=1e-15)
    assert_array_equal(run["heave"], HEAVE)
    assert set(run.data_vars) == {"heave", "wave"}
    assert (run["heave"].attrs["units"], run["wave"].attrs["units"]) == ("mm", "m")


def test_a_time_channel_and_integers(tmp_path):
    path = save(
        tmp_path,
        channel("Time", 1e3 * T, unit_string="ms"),
        channel("count", np.arange(200, dtype=np.int16)),
        channel("remark", ["x"] * 200),
    )
    run = read_table(path)
    assert_allclose(run["time"], T, rtol=1e-12)
    assert_array_equal(run["count"], np.arange(200.0))
    assert set(run.data_vars) == {"count"}


def test_time_stamps_count_from_the_first(tmp_path):
    start = np.datetime64("2024-05-06T07:08:09.000000")
    stamps = start + (1e6 * T).round().astype("timedelta64[us]")
    path = save(tmp_path, channel("Time", stamps), channel("heave", HEAVE))
    # Time stamps are written in microseconds here.
    assert_allclose(read_table(path)["time"], T, atol=1e-6)


def test_scaled_channels(tmp_path):
    """Counts with a linear scale in the properties are read in the scale's unit."""
    scale = {
        "NI_Number_Of_Scales": 1,
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.5,
        "NI_Scale[0]_Linear_Y_Intercept": 10.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
        "wf_increment": STEP,
    }
    path = save(tmp_path, channel("load", np.arange(200, dtype=np.int32), **scale))
    assert_array_equal(read_table(path)["load"], 10 + 0.5 * np.arange(200))


def test_groups(tmp_path):
    path = save(
        tmp_path,
        channel("heave", HEAVE, **WAVEFORM),
        channel("load", np.arange(2000.0), "loads", wf_increment=0.005),
    )
    with pytest.raises(
        RequestError,
        match=r"several groups that are sampled differently: 'loads' \(1 channels of 2000\), 'run' "
        r"\(1 channels of 200\)\. State which one with group = 'NAME'",
    ):
        read_table(path)
    assert read_table(path, FileSettings(group="loads")).sizes["time"] == 2000
    with pytest.raises(RequestError, match=r"no group 'load'\. Did you mean 'loads'\? Its groups"):
        read_table(path, FileSettings(group="load"))
