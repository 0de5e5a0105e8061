"""Steps of the chain through a campaign file, against bodies, tones and clocks that are known."""

from functools import cache
from math import tau

import numpy as np
import pandas as pd
import pytest
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from pages import page
from said import data_error, findings, request_error
from seas import sea
from small_tank import campaign_of, tank_columns, write_csv
from tutorial_study import edit

from seakeep import read_campaign
from seakeep.signals import rotation_matrix

AXES, G = ("surge", "sway", "heave"), 9.81
T = 0.01 * np.arange(1500)
ARM = np.array([-1.2, 0.3, -0.1])  # from the centre of gravity to the bow, in the body's axes


def body(t):
    """Displacement of the centre of gravity, and roll, pitch and yaw, of a body in waves."""
    w = tau * np.array([0.45, 0.6, 0.75])
    position = np.column_stack([0.05 * np.sin(w[0] * t), 0.02 * np.sin(w[1] * t + 1),
                                0.04 * np.sin(w[2] * t + 2)])  # fmt: skip
    angles = np.column_stack([0.03 * np.sin(w[2] * t), 0.12 * np.sin(w[1] * t + 0.4),
                              0.02 * np.sin(w[0] * t + 2)])  # fmt: skip
    return position, angles


def rate(function, order):
    """Derivatives of a smooth function by differences of eighth order, exact to 1e-8 here."""
    h, weights = 0.01, [4 / 5, -1 / 5, 4 / 105, -1 / 280]
    if order == 0:
        return function
    lower = rate(function, order - 1)
    return lambda t: (
        sum(w * (lower(t + k * h) - lower(t - k * h)) for k, w in enumerate(weights, 1)) / h
    )


def bow(t):
    """Displacement of the bow from its place at rest."""
    position, angles = body(t)
    return position + rotation_matrix(angles) @ ARM - ARM


def angular_velocity(t):
    """About the body's axes: what is antisymmetric in the turning rotation."""
    turn = rotation_matrix(body(t)[1])
    by = np.einsum("tji,tjk->tik", turn, rate(lambda s: rotation_matrix(body(s)[1]), 1)(t))
    return np.column_stack([by[:, 2, 1], by[:, 0, 2], by[:, 1, 0]])


@cache
def turning():
    """Angular velocity and acceleration at the instants of the run."""
    return angular_velocity(T), rate(angular_velocity, 1)(T)


def prepared(folder, columns, text, time=T):
    """The run of a file, by a campaign whose last table may be that of the run."""
    write_csv(folder / "run.csv", {"time [s]": time, **columns})
    of_run = "" if "[runs.r]" in text else "[runs.r]\n"
    return campaign_of(folder, f"{text}\n{of_run}file = 'run.csv'\n").prepare()["r"]


def gyroscope():
    """Columns of angles, angular velocities and accelerations, and their channels."""
    omega, alpha = turning()
    columns, text = {}, ""
    for i, name in enumerate(("roll", "pitch", "yaw")):
        for kind, values, unit in (
            ("", np.rad2deg(body(T)[1][:, i]), "deg"),
            ("_rate", np.rad2deg(omega[:, i]), "deg/s"),
            ("_acceleration", alpha[:, i], "rad/s^2"),
        ):
            columns[f"{name}{kind} [{unit}]"] = values
            text += f"[channels.{name}{kind}]\n"
    return columns, text


def test_motions_are_transferred_to_another_point(tmp_path):
    """Positions, velocities and accelerations of the bow from those of the centre of gravity."""
    columns, text = gyroscope()
    for axis, name in enumerate(AXES):
        for order, kind, unit in ((0, "", "mm"), (1, "_rate", "m/s"), (2, "_acceleration", "g")):
            scale = {"mm": 1e3, "m/s": 1.0, "g": 1 / 9.80665}[unit]
            values = rate(lambda t: body(t)[0], order)(T)[:, axis] * scale
            columns[f"{name}{kind} [{unit}]"] = values
            text += (
                f"[channels.{name}{kind}]\n[derived.bow_{name}{kind}]\nfrom = '{name}{kind}'\n"
                f"step = 'transfer'\noffset = {ARM.tolist()}\n"
            )
    run = prepared(tmp_path, columns, text)
    for axis, name in enumerate(AXES):
        for order, kind in enumerate(("", "_rate", "_acceleration")):
            found = run[f"bow_{name}{kind}"]
            # Eighth-order differences of differences leave 1e-7 of accelerations of 1 m/s².
            assert_near(found, rate(bow, order)(T)[:, axis], 1e-6)
            assert "m from where it was measured" in found.attrs["derived_from"]


def test_an_integral_is_right_beside_a_gap(tmp_path):
    # Packets of more than a wave are lost; a cubic across the gap leaves 3 SD beside it.
    t = 0.1 * np.arange(3000)
    omega, phase = np.linspace(0.7, 1.6, 12), np.arange(12.0) ** 2
    heave = np.cos(np.outer(t, omega) + phase)
    truth = heave.sum(axis=1)
    acceleration = 0.05 - heave @ omega**2 + 0.03 * np.random.default_rng(0).standard_normal(t.size)
    there = (t < 150) | (t >= 158)
    columns = {"heave_acceleration [m/s^2]": acceleration, "truth [m]": truth}
    run = prepared(
        tmp_path,
        {name: values[there] for name, values in columns.items()},
        "preparation = {sampling_rate = 10, gaps = 'mask'}\n"
        "channels = {heave_acceleration = {}, truth = {}}\n"
        "derived.heave = {from = 'heave_acceleration', step = 'integrate', times = 2, "
        "band = [0.04, 1.5]}\n",
        time=t[there],
    )
    error = (run["heave"] - run["truth"]).values / truth.std()
    assert_array_equal(np.isnan(error), ~there)
    assert np.nanmax(np.abs(error[300:-300])) < 0.1


@pytest.mark.parametrize("zeroed", [False, True])
def test_gravity_is_removed_from_accelerometers(tmp_path, zeroed):
    """Three accelerometers at the bow of a body that tilts by up to 7 degrees."""
    acceleration = rate(bow, 2)(T)
    felt = np.einsum(
        "tji,tj->ti", rotation_matrix(body(T)[1]), acceleration + np.array([0, 0, G])
    ) - np.array([0, 0, G * zeroed])
    columns, text = gyroscope()
    columns |= {f"a_{axis} [m/s^2]": felt[:, i] for i, axis in enumerate("xyz")}
    for name, axis in (("surge", "x"), ("sway", "y"), ("heave", "z")):
        text += (
            f"[channels.a_{axis}]\n[derived.{name}_acceleration]\nfrom = 'a_{axis}'\n"
            "step = 'remove_gravity'\ncomponents = ['a_x', 'a_y', 'a_z']\n"
            f"zeroed = {str(zeroed).lower()}\n"
        )
    run = prepared(tmp_path, columns, text)
    for i, name in enumerate(AXES):
        found = run[f"{name}_acceleration"]
        assert_near(found, acceleration[:, i], 1e-6)
        assert found.attrs["derived_from"] == f"a_{'xyz'[i]}, gravity removed by roll, pitch, yaw"


@pytest.mark.parametrize("axis", ["x", "z"])
def test_gravity_is_removed_from_one_accelerometer(tmp_path, axis):
    """Left is the acceleration along the body's own axis: its turning stays."""
    i = "xyz".index(axis)
    acceleration, turn = rate(bow, 2)(T), rotation_matrix(body(T)[1])
    along = np.einsum("tj,tj->t", turn[:, :, i], acceleration)
    columns, text = gyroscope()
    columns["a [m/s^2]"] = along + G * turn[:, 2, i]
    text += f"[channels.a]\n[derived.free]\nfrom = 'a'\nstep = 'remove_gravity'\naxis = '{axis}'\n"
    assert_near(prepared(tmp_path, columns, text)["free"], along, 1e-9)


@pytest.mark.parametrize("outliers", ["replace", "flag"])
def test_outliers_are_flagged_and_replaced_when_asked(tank, first, outliers):
    spikes, columns = [400, 401, 777, 900], tank_columns(0)
    columns["Heave [mm]"][spikes] += [900, 900, -700, 500]
    write_csv(tank / "first.csv", columns)
    run = first(("sampling_rate = 10", f'dt = 0.02\noutliers = "{outliers}"'))
    flags = run["heave_flags"]
    bits = dict(zip(flags.attrs["flag_meanings"].split(), flags.attrs["flag_masks"], strict=True))
    marked = np.flatnonzero(flags.values & bits["outlier"])
    assert set(spikes) <= set(marked)
    assert len(marked) <= 3 * len(spikes)  # a flag covers half a step on either side
    if outliers == "flag":
        assert run["heave"].max() > 0.8
        assert "repaired" not in run["heave"].attrs
        return
    assert_array_equal(marked, np.flatnonzero(flags.values & bits["replaced"]))
    clean = 1e-3 * tank_columns(0)["Heave [mm]"]
    # One or two samples of a wave of 50: what a monotone cubic puts there is off by 1 %.
    assert_near(run["heave"], clean, 0.01 * np.ptp(clean))
    assert run["heave"].attrs["repaired"] == "4 outliers replaced by monotone cubics"


RATE, PERIOD = 500.0, 1.64


def test_the_paper_preset_of_the_preparation(tmp_path):
    """Pass 10 Hz, stop 10.75 Hz, then 32 samples per period, and no other filter."""
    t, columns = np.arange(0, 60, 1 / RATE), {}
    text = f"[campaign]\nencounter_period = {PERIOD}\n[preparation]\npreset = 'paper'\n"
    for f in (0.61, 5.0, 7.7, 9.9, 11.0, 30.0):
        name = f"tone_{f:g}".replace(".", "p")
        columns[f"{name} [m]"] = np.cos(tau * f * t)
        text += f"[channels.{name}]\n"
    run = prepared(tmp_path, columns, text, t)
    assert run.attrs["preparation_preset"] == "paper"
    assert run.attrs["dt"] == PERIOD / 32
    assert run["tone_5"].attrs["low_pass"] == (10.0, 10.75)
    # Root mean square of each tone, in parts of a cosine's, away from the ends.
    inner = run.isel(time=slice(150, -150))
    found = [float(np.sqrt(2 * np.mean(each.values**2))) for each in inner.data_vars.values()]
    # 60 dB either way; the mean over a broken number of cycles leaves a part in a hundred.
    # 9.9 Hz passes, lies above the new Nyquist frequency (9.76 Hz) and is folded to 9.61 Hz.
    assert_near(found[:4], 1, 0.02)
    assert max(found[4:]) < 2e-3


def two_probes(folder, positions, spans=""):
    """A long wave that passes two probes, one after the other, at 2 m/s, and at first at 2.5."""
    t = np.arange(0, 120, 0.05)
    late = np.where(t < 60, 0.4, 0.5) if spans else 0.5
    waves = 0.05 * np.sin(tau * 0.78 * t), 0.05 * np.sin(tau * 0.78 * (t - late))
    text = (
        f"[rig]\nwater_depth = 3.6\n[rig.positions]\n{positions}\n[channels.eta_a]\n"
        f"[channels.eta_b]\n[runs.r]\nwaves = 'regular'\n{spans}"
    )
    return prepared(folder, {"eta_a [m]": waves[0], "eta_b [m]": waves[1]}, text, t)


def test_a_prepared_run_has_the_celerity_of_its_waves(tmp_path):
    # A parabola through three samples of a sine of 26 samples a period: some 1e-3 of a step.
    run = two_probes(tmp_path, "eta_a = 4.0\neta_b = 5.0")
    assert_allclose(run.attrs["celerity"], 2.0, rtol=1e-3)
    assert_near(run.attrs["celerity_correlation"], 1.0, 1e-3)
    # The start-up is used by none: what lies before the spans decides nothing.
    run = two_probes(tmp_path, "eta_a = 4.0\neta_b = 5.0", "train = [61, 90]\ntest = [90, 119]")
    assert_allclose(run.attrs["celerity"], 2.0, rtol=1e-3)
    assert not findings(run, "CELERITY")
    assert "celerity" not in two_probes(tmp_path, "eta_a = 4.0\neta_b = 4.0").attrs


@pytest.mark.parametrize(("part", "kind", "told"), [
    (0.55, "irregular", 0), (0.45, "irregular", 1), (0.45, "still", 0),
])  # fmt: skip
def test_a_celerity_between_waves_that_are_hardly_alike_is_told(tmp_path, part, kind, told):
    """One sea that passes both probes, and another at the second."""
    t, both = np.arange(0, 400, 0.05), sea(1)
    second = part * both.at(t, 0.5) + np.sqrt(1 - part**2) * sea(2).at(t)
    text = (
        "[rig]\nwater_depth = 3.6\n[rig.positions]\neta_a = 4.0\neta_b = 4.5\n"
        f"[channels.eta_a]\n[channels.eta_b]\n[runs.r]\nwaves = '{kind}'"
    )
    run = prepared(tmp_path, {"eta_a [m]": 0.02 * both.at(t), "eta_b [m]": 0.02 * second}, text, t)
    found = [each.text for each in findings(run, "CELERITY")]
    assert found == told * [
        "correlates by only 0.41 with eta_a at the lag that gives the run's celerity "
        f"({run.attrs['celerity']:.2f} m/s), which may be wrong"
    ]


def test_a_sensor_that_sticks_is_reported_in_times_that_jitter(tmp_path):
    t, rng = np.arange(0, 120, 0.05), np.random.default_rng(0)
    x = 0.05 * np.sin(tau * 0.38 * t)
    x[1000:1040] = x[1000]
    text = "[channels.eta_a]\n[preparation]\njitter = 'interpolate'\nsampling_rate = 10\n"
    run = prepared(tmp_path, {"eta_a [m]": x}, text, t + 6e-4 * rng.uniform(-1, 1, t.size))
    (stuck,) = findings(run, "STUCK")
    assert stuck.details["samples"] == 40


@pytest.mark.parametrize("mean", [-20.0, 1.0, 350.0])
def test_a_heading_has_no_jumps_of_a_whole_turn(tmp_path, mean):
    heading = mean + 5 * np.sin(tau * 0.1 * T)
    columns = {"yaw [deg]": np.where(np.arange(T.size) % 500 == 7, np.nan, heading % 360)}
    text = "[channels.yaw]\n[preparation]\nsampling_rate = 10\ngaps = 'bridge'\nlongest_gap = 1\n"
    run = prepared(tmp_path, columns, text)
    expected = (np.interp(run["time"], T, heading) + 180) % 360 - 180
    # Cubics over the gaps and the filter before resampling leave 0.02 degrees.
    assert_near(np.degrees(run["yaw"][10:-10]), expected[10:-10], 0.02)
    counts = [each.details["count"] for each in findings(run, "JUMPS")]
    assert counts == ([2] if mean == 1.0 else [])


def test_dates_and_seconds_of_day_are_in_step_over_midnight(tmp_path):
    """Loggers of each way to write when, some of which start after midnight, and one of none."""
    names = "unix", "shore", "mast", "excel", "matlab", "plc", "java", "camera"
    t = 86399.5 + np.arange(0, 60, 0.1)
    dates = pd.Timestamp("2024-05-03") + pd.to_timedelta(t, unit="s")
    since = 86400 * 19846 + t  # days from 1970 to that one
    times = (
        since[10:], dates.strftime("%Y-%m-%d %H:%M:%S.%f"),
        dates[10:].strftime("%Y-%m-%dT%H:%M:%S.%fZ"), 45415 + t[10:] / 86400, 739375 + t / 86400,
        t % 86400, 1000 * since, dates.strftime("%H:%M:%S.%f"),
    )  # fmt: skip
    text = (
        "[channels]\n[instruments]\nreference = 'shore'\n"
        "[instruments.camera]\nsampling_rate = 10\noffset = -86399.5\n"
    )
    for name, time in zip(names, times, strict=True):
        write_csv(
            tmp_path / f"{name}.csv", {"time": time, f"z {name} [m]": t[-len(time) :] - 86400}
        )
        unit = {"excel": "d", "matlab": "d", "java": "ms"}.get(name)
        text += f"[channels.z_{name}]\ncolumn = 'z {name}'\n"
        text += f"[instruments.{name}]\n" * (name != "camera")
        text += f"time_unit = '{unit}'\n" if unit else ""
    files = "".join(f"{name} = '{name}.csv'\n" for name in names)
    path = tmp_path / "campaign.toml"
    path.write_text(f"{text}[preparation]\nsampling_rate = 10\n[runs.r]\n[runs.r.files]\n{files}")
    with request_error("shore.csv state a zone, and the others none.*offset = 0.0 in .*mast."):
        read_campaign(path).prepare()
    edit(path, ("[instruments.mast]\n", "[instruments.mast]\noffset = 0.0\n"))
    for reference in ("shore", "unix"):
        edit(path, ("reference = 'shore'", f"reference = '{reference}'"))
        run = read_campaign(path).prepare()["r"]
        assert float(run["time"][0]) == pytest.approx(86400.5)
        for name in names:  # a channel that is its own instant
            assert_near(run[f"z_{name}"], run["time"] - 86400, 1e-3)
    edit(path, ("[instruments.camera]\n", "[instruments.camera]\ntime = 'time'\n"))
    with data_error("only where no row is lost, leave time out and state sampling_rate"):
        read_campaign(path).prepare()


def test_measurements_at_sea_are_made_waves_and_angles_as_the_page_says(tmp_path):
    t = np.arange(0, 1200, 0.2)
    jacket, bow_wave, heave = (np.cos(0.6 * t + phase) for phase in (0.0, 0.5, 0.8))
    pitch, yaw, wind = 0.01 * np.cos(0.6 * t), 0.03 * np.sin(0.02 * t), 0.2 * np.sin(0.1 * t)
    columns = {
        "JKT_AIRGAP [m]": 24 - jacket - 0.4 * np.sin(tau * t / 12000),  # with a tide
        "BOW_AIRGAP [m]": 13.5 + heave + 150 * pitch - bow_wave,
        "MRU.Heave (down) [m]": -heave,
        "MRU.Pitch [deg]": np.degrees(pitch),
        "GYRO_HDG [deg]": np.degrees(-yaw) % 360,
        "Wind speed [m/s]": 10 + 0 * t,
        "Wind dir [deg]": np.degrees(wind) % 360,
    }
    run = prepared(
        tmp_path, columns, page("howto/data.md").split("```toml\n")[2].split("```")[0], t
    )
    inner = run.isel(time=slice(500, -500))  # a band reaches over the ends
    assert_near(inner["eta_jacket"], np.cos(0.6 * inner["time"].values), 1e-2)  # of the tide's ends
    assert_near(run["eta_bow"], bow_wave, 1e-5)  # decimals of the file
    assert_near(run["yaw"], yaw, 1e-5)  # its sine
    assert_near(run["wind_x"], 100 * np.cos(wind), 1e-3)


WANDER = sea(5, (0.2, 1.0)).at  # without a period of its own, so that a lag is unique


@pytest.mark.parametrize("way", ["shared", "correlated"])
@pytest.mark.parametrize(("offset", "drift"), [(7200.731, 0.0), (-1.204, 60e-6)])
def test_clocks_from_signals(tmp_path, way, offset, drift):
    """A camera of 30 Hz beside a logger of 100 Hz: one signal in both, or two that go together."""
    rng = np.random.default_rng(1)
    reference = np.arange(0, 200, 0.01)
    seen = np.arange(0.0, 190, 1 / 30) + max(offset, 0)
    at = (seen - offset) / (1 + drift)
    other = 4 * WANDER(at) + 0.3 * np.cos(2.2 * at) * (way == "correlated")
    write_csv(tmp_path / "loads.csv", {
        "time [s]": reference, "draught [m]": 0.4 * WANDER(reference),
    })  # fmt: skip
    write_csv(tmp_path / "camera.csv", {
        "time [s]": seen, "heave [mm]": 50 * other + 2 * rng.standard_normal(seen.size),
    })  # fmt: skip
    near = "offset = 7200\n" if offset > 7200 else ""
    campaign = campaign_of(
        tmp_path,
        "[channels.draught]\n[channels.heave]\n[instruments]\nreference = 'loads'\n"
        f"[instruments.loads]\n[instruments.camera]\n{way} = ['heave', 'draught']\n{near}"
        "[preparation]\nsampling_rate = 20\n[runs.r]\nspan = [5, 185]\n[runs.r.files]\n"
        "loads = 'loads.csv'\ncamera = 'camera.csv'\n",
    )
    path = campaign.path
    clock = campaign.clocks()["r"]["camera"]
    # Noise of 1 % of the motion on 5 700 frames; two signals that differ leave windows apart.
    assert_near(clock.offset, offset, 3e-4 if way == "shared" else 3e-3)
    assert abs(clock.drift - drift) < (4e-6 if way == "shared" else 3e-5)
    assert abs(clock.offset - offset) < 5 * clock.offset_error
    assert abs(clock.drift - drift) < 5 * clock.drift_error
    words = {"shared": "shared channel", "correlated": "correlation of windows"}
    run = campaign.prepare()["r"]
    assert words[way] in run.attrs["clock_camera"]
    assert run.attrs["clock_camera_offset"] == pytest.approx(clock.offset)
    if way == "shared":  # the channels fall together once the clock is turned back
        pair = run[["draught", "heave"]].isel(time=slice(100, -100))
        assert np.corrcoef(pair["draught"], pair["heave"])[0, 1] > 0.999
    stated = "window = 24\nlargest_lag = 6\n[campaign]\nencounter_period = 3\n[preparation]"
    edit(path, ("[preparation]", stated))
    expected = read_campaign(path).clocks()["r"]["camera"]
    edit(path, ("window = 24", "window = '8 T'"), ("largest_lag = 6", "largest_lag = '2 T'"))
    assert read_campaign(path).clocks()["r"]["camera"] == expected
