"""The numbers of README.md that no seakeep command prints: the other record, and what is possible.

Run in the repository, with SEAKEEP_DATA_DIR set:

    python examples/sjtu_semisub/checks.py
"""

from pathlib import Path

import numpy as np
from scipy import signal

import seakeep
from seakeep.campaign import read_table
from seakeep.study import compare, fit_campaign

HERE = Path(__file__).parent


def tenths(campaign, model):
    """NRMSE of heave in ten pieces of the forecast: does it fade?"""
    (judged,) = compare(model, campaign)
    error = (judged.forecast.heave - judged.measured.heave).values
    pieces = zip(
        np.array_split(error, 10), np.array_split(judged.measured.heave.values, 10), strict=True
    )
    parts = [np.sqrt(np.mean(e**2)) / m.std(ddof=1) for e, m in pieces]
    print("NRMSE of heave by tenths of the forecast: " + ", ".join(f"{p:.2f}" for p in parts))


def other_record(campaign, model):
    """Forecast Data02, whose probe stood elsewhere, with the model of Data01."""
    table = read_table(campaign.file_of("Data01").with_name("Data02.csv"))
    run = table.rename({"WP": "eta_wp", "Heave": "heave"})
    forecast = model.forecast(run, start=float(run.time[model.history_samples - 1]))
    judged = seakeep.metrics.nrmse(predicted=forecast, measured=run)
    print(f"NRMSE of heave, Data02 with the model of Data01: {float(judged.heave):.3f}")


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
    other_record(campaign, model)
    linear_bound(campaign, model)


if __name__ == "__main__":
    main()
