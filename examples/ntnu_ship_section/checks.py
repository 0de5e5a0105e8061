"""Numbers of README.md that no seakeep command prints: sway, springs, repeats, periods, reach …

Run in the repository, with SEAKEEP_DATA_DIR set:

    python examples/ntnu_ship_section/checks.py            # all
    python examples/ntnu_ship_section/checks.py sway       # one of them
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import seakeep
from seakeep import metrics, signals
from seakeep.baselines import ARX
from seakeep.campaign import read_table
from seakeep.study import fit_campaign

HERE = Path(__file__).parent
GRAVITY, ARM, BAND = 9.81, 0.0502, (0.4, 5.0)


def sway(campaign, runs):
    """SD of sway rebuilt in four ways over that of the springs, 0.4 to 5 Hz and unfiltered."""
    print("SD of sway over SD of the springs' (T_SB - T_PS)/60")
    print("        in the band 0.4 to 5 Hz             unfiltered springs      tilt/sway")
    print("run     corrected  wrong sign   no arm    corrected  wrong sign")
    for name, run in runs.items():
        dt = float(run.attrs["dt"])
        roll, second = run["roll"].values, run["roll_acceleration"].values
        felt = run["acc_sway"].values
        springs = run["spring_offset_in_band"].values
        unfiltered = run["spring_offset"].values
        ways = [
            felt - GRAVITY * roll - ARM * second,
            felt + GRAVITY * roll + ARM * second,
            felt - GRAVITY * roll,
        ]
        twice = [signals.integrate(each, dt, BAND, times=2) for each in ways]
        period = signals.encounter_period(run["heave"].values[500:], dt)
        tilt = GRAVITY * roll.std() / (2 * np.pi / period) ** 2
        print(
            f"{name}  " + "".join(f"{each.std() / springs.std():10.3f}" for each in twice),
            "".join(f"{each.std() / unfiltered.std():12.3f}" for each in twice[:2]),
            f"{tilt / twice[0].std():12.1f}",
        )


def springs(campaign, runs):
    """Part of the variance of each spring tension that lies below the waves."""
    print("part of the variance of the tensions below 0.4 Hz")
    for name, run in runs.items():
        parts = []
        for side in ("starboard", "port"):
            tension = run[f"mooring_{side}"].values
            fast = signals.band_pass(tension, float(run.attrs["dt"]), BAND)
            parts.append(1 - fast.var() / tension.var())
        print(f"{name}  starboard {parts[0]:.2f}  port {parts[1]:.2f}")


def repeats(campaign, runs):
    """What runs of the same waves differ by, in SDs of the first, from 28 s on."""
    channels = ["eta_wp1", "heave", "roll", "mooring_starboard", "mooring_port"]
    print("NRMSE between runs of the same waves, at the lag of their best agreement in eta_wp1")
    print("runs            " + "  ".join(f"{each:>17s}" for each in channels))
    pairs = [("3061_2", "3061_1"), ("3101_3", "3101_4")]
    pairs += [("3102_3", other) for other in ("3102_1", "3102_2", "3102_4")]
    for name, other in pairs:
        one, two = runs[name], runs[other]
        dt, count = float(one.attrs["dt"]), min(one.sizes["time"], two.sizes["time"])
        waves = [each["eta_wp1"].values[:count] for each in (one, two)]
        lag, _ = signals.correlation_peak(*waves, dt, (-6, 6))
        shift, first = round(lag / dt), round(28 / dt)
        begin, end = max(first, first - shift), min(one.sizes["time"], two.sizes["time"] - shift)
        errors = []
        for channel in channels:
            a, b = one[channel].values[begin:end], two[channel].values[begin + shift : end + shift]
            errors.append(np.sqrt(np.mean((a - b) ** 2)) / a.std())
        print(f"{name}, {other}  " + "  ".join(f"{error:17.2f}" for error in errors))


def camera(campaign, runs):
    """Lag of the camera's heave behind the accelerometers', s, in pieces of 10 s from 20 s on."""
    print("lag of the camera's heave, s (pieces of 10 s, from 20 s on); SD of its channel, mm")
    for name, run in runs.items():
        dt = float(run.attrs["dt"])
        raw = read_table(campaign.files_of(name)[""], columns=["Heave [m]"])
        (column,) = raw.data_vars
        seen = np.interp(run.time.values, raw.time.values, raw[column].values)
        if seen.std() < 1e-6:
            print(f"{name}  constant: {seen[0]:.6f} m")
            continue
        seen = signals.band_pass(seen, dt, BAND)
        lags = []
        for first in range(500, run.sizes["time"] - 250, 250):
            piece = slice(first, first + 250)
            lag, _ = signals.correlation_peak(run["heave"][piece], seen[piece], dt, (-0.6, 0.6))
            lags.append(lag)
        print(f"{name}  " + " ".join(f"{lag:6.2f}" for lag in lags))


def means(campaign, runs):
    """Mean of the two vertical accelerometers: body-fixed sensors lose gravity as they tilt."""
    print("mean of (acc_starboard + acc_port)/2 and of -g phi^2/2, m/s^2")
    for name, run in runs.items():
        both = 0.5 * (run["acc_starboard"] + run["acc_port"])
        tilted = -GRAVITY * float((run["roll"] ** 2).mean()) / 2
        print(f"{name}  {float(both.mean()):7.3f}  {tilted:7.3f}")


def ends(campaign, runs):
    """What a record that stops in mid-wave does to the last 5 s of its double integral."""
    print("RMS error of the last 5 s of a record cut in mid-wave, in SDs: median (90 %)")
    print("channel                 continued by prediction   continued by zeros")
    for channel in ("heave_acceleration", "roll_acceleration"):
        errors = []
        for run in runs.values():
            dt, series = float(run.attrs["dt"]), run[channel].values
            whole = signals.integrate(series, dt, BAND, times=2)
            for cut in range(250, 500, 17):
                kept = series.size - cut
                short = signals.integrate(series[:kept], dt, BAND, times=2)
                zeros = np.zeros(2 * kept - 1)
                zeros[:kept] = series[:kept]
                abrupt = signals.integrate(zeros, dt, BAND, times=2)[:kept]
                spread = whole[kept - 500 : kept].std()
                last = slice(kept - 125, kept)
                errors.append(
                    [
                        np.sqrt(np.mean((e[last] - whole[last]) ** 2)) / spread
                        for e in (short, abrupt)
                    ]
                )
        middle, high = np.median(errors, axis=0), np.percentile(errors, 90, axis=0)
        print(
            f"{channel:20s}  "
            + "".join(f"{m:16.3f} ({h:.3f})" for m, h in zip(middle, high, strict=True))
        )


def periods(campaign, runs):
    """Each training run forecast by the other nine: NRMSE of the motions."""
    model = fit_campaign(campaign)
    spec, states = model.settings, model.states  # as chosen on all ten
    print("left out   " + "  ".join(f"{name:>10s}" for name in states))
    train = campaign.training_runs
    for name in train:
        others = {each: runs[each] for each in train if each != name}
        alone = spec.fit(others, states, model.inputs)
        first = float(runs[name].time[alone.history_samples - 1])
        forecast = alone.forecast(runs[name], start=first)
        judged = metrics.nrmse(predicted=forecast, measured=runs[name])
        print(f"{name:10s} " + "  ".join(f"{float(judged[s]):10.3f}" for s in states))


def reach(campaign, runs):
    """Error over the test runs by how far back and ahead the waves are read, beside ARX."""
    chosen = fit_campaign(campaign)
    train = {name: runs[name] for name in campaign.training_runs}
    powers = chosen.settings.observables
    print("mean ANRMSE of three test runs from 30 s on; look-ahead and delays of the waves in T")
    print("ahead  delays  reaches back     HDMDc  HDMDc, powers       ARX  ARX, powers")
    for ahead, delays in ((0.76, 3), (0, 3), (0.76, 5), (0, 5)):
        errors = []
        for spec in (chosen.settings, ARX(25, 0, ridge="rollout", ridge_scale="per_snapshot")):
            for observables in ((), powers):
                lead, back = round(25 * ahead), 25 * delays
                each = replace(spec, lead=lead, input_delays=back, observables=observables)
                model = each.fit(train, chosen.states, chosen.inputs)
                forecasts = [(model.forecast(runs[n], start=30.0), n) for n in campaign.test_runs]
                tables = [metrics.nrmse(predicted=f, measured=runs[n]) for f, n in forecasts]
                errors.append(np.mean([float(t[s]) for t in tables for s in model.states]))
        words = "".join(f"{error:13.3f}" for error in errors)
        print(f"{ahead:5.2f}  {delays:6d}  {delays - ahead:12.2f}{words}")


CHECKS = {
    each.__name__: each for each in (sway, springs, repeats, camera, means, ends, periods, reach)
}


def main(names):
    campaign = seakeep.read_campaign(HERE / "campaign.toml")
    runs = campaign.prepare()
    for name in names or CHECKS:
        CHECKS[name](campaign, runs)
        print()


if __name__ == "__main__":
    main(sys.argv[1:])
