"""The numbers of README.md that no seakeep command prints: the probe's offset, what is possible.

Run in the repository, with SEAKEEP_DATA_DIR set:

    python examples/sjtu_semisub/checks.py
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import signal

import seakeep
from seakeep.study import compare, fit_campaign
from seakeep.study.plan import between
from seakeep.waves import phase_speed

HERE = Path(__file__).parent


SPAN = (0.0, 3065.0)
"""The first 30 % of Data02, from which its probe offset is estimated, s."""


def tenths(campaign, model):
    """NRMSE of heave in ten pieces of the forecast: does it fade?"""
    (judged,) = compare(model, campaign, ["Data01"])
    error = (judged.forecast.heave - judged.measured.heave).values
    pieces = zip(
        np.array_split(error, 10), np.array_split(judged.measured.heave.values, 10), strict=True
    )
    parts = [np.sqrt(np.mean(e**2)) / m.std(ddof=1) for e, m in pieces]
    print("NRMSE of heave by tenths of the forecast: " + ", ".join(f"{p:.2f}" for p in parts))


def probe_offset(campaign, model):
    """Data02's probe offset from its first 30 %, and what a constant time lag does instead."""
    run = campaign.prepare(["Data02"])["Data02"]
    start = run.attrs["test_span"][0]
    measured = run.sel(time=slice(start + 0.5 * model.dt, None))

    def error(one, offset):
        moved = run.assign_attrs(probe_offset=offset)
        forecast = one.forecast(moved, start=start)
        return float(seakeep.metrics.nrmse(predicted=forecast, measured=measured).heave)

    uncorrected = error(model, 0.0)
    print(f"NRMSE of heave, the last 70 % of Data02, uncorrected: {uncorrected:.3f}")
    # One celerity turns a distance into a lag; at a spectrum's peak it is this phase speed.
    peak = seakeep.signals.peak_period(run.eta_wp.values, model.dt)
    celerity = float(phase_speed(2 * np.pi / peak))
    lagging = replace(
        model.settings,
        alignment=seakeep.ProbeAlignment(mode="effective", surge="none", celerity=celerity),
    )
    train = campaign.prepare(["Data01"])["Data01"]
    train = between(train, train.attrs["train_span"])
    by_lag = lagging.fit(train, model.states, model.inputs)
    for one, unit, factor in ((model, "m", 1.0), (by_lag, "s", 1 / celerity)):
        found = seakeep.estimate_probe_offset(one, run, SPAN)
        corrected = error(one, found.offset)
        low, high = (factor * edge for edge in found.interval)
        print(
            f"  {'offset by dispersion' if unit == 'm' else 'constant time lag'}: "
            f"{factor * found.offset:.3g} ± {factor * found.spread:.2g} {unit} (95 %: {low:.3g} to "
            f"{high:.3g}), NRMSE {corrected:.3f}, {corrected / uncorrected:.2f} of the uncorrected"
        )


def linear_bound(campaign, model):
    """NRMSE of the best linear model that may also look into the future, by coherence."""
    run = campaign.prepare()["Data01"]
    rate = 1 / float(run.attrs["dt"])
    for samples in (256, 512, 1024):
        _, alike = signal.coherence(run.heave, run.eta_wp, rate, nperseg=samples)
        _, power = signal.welch(run.heave, rate, nperseg=samples)
        bound = np.sqrt(((1 - alike) * power).sum() / power.sum())
        print(f"linear bound, segments of {samples} samples: {bound:.3f}")


def main():
    campaign = seakeep.read_campaign(HERE / "campaign.toml")
    model = fit_campaign(campaign)
    tenths(campaign, model)
    probe_offset(campaign, model)
    linear_bound(campaign, model)


if __name__ == "__main__":
    main()
