"""What a model in service costs, and what it gives up: steps, bands, and the chain of raw samples.

python benchmarks/live.py steps [COUNT]                  # time and memory of COUNT steps
python benchmarks/live.py bands MODEL.nc CAMPAIGN.toml RUN    # coverage at one step and 5 T
python benchmarks/live.py chain MODEL.nc CAMPAIGN.toml RUN    # live chain against the offline one
"""

import resource
import sys
import time
from pathlib import Path

import numpy as np
import xarray as xr

import seakeep
from seakeep.campaign import load_prepared
from seakeep.formats import read_columns

TUTORIAL = Path(__file__).parents[1] / "docs" / "tutorial" / "campaign.toml"
DELAYS = ("0.25 T", "1 T", "4 T")


def memory():
    """Largest memory of the process so far, MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def steps(count=1_000_000):
    """Play the tutorial's unseen run over and over; one sample in a thousand has no states."""
    campaign = seakeep.read_campaign(TUTORIAL)
    model = seakeep.study.fit_campaign(campaign)
    run = load_prepared(campaign, names=["unseen"])["unseen"]
    u = np.stack([run[name].values for name in model.inputs], axis=1)
    y = np.stack([run[name].values for name in model.states], axis=1)
    live, begun, before = model.live(), time.process_time(), memory()
    for number in range(int(count)):
        at = number % len(u)
        live.step(u[at], None if number % 1000 == 999 else y[at])
        if (number + 1) % max(int(count) // 5, 1) == 0:
            spent = 1e6 * (time.process_time() - begun) / (number + 1)
            print(
                f"{number + 1} steps: {spent:.0f} µs of CPU per step, {memory() - before:+.1f} MiB"
            )


def bands(model, campaign, name):
    """Part of the measurement in the 95 % bands, averaged over channels; waves known or not."""
    fitted, read = seakeep.load_model(model), seakeep.read_campaign(campaign)
    run = load_prepared(read, names=[name])[name]
    lead = round(read.seconds("5 T") / fitted.dt)
    u = np.stack([run[each].values for each in fitted.inputs], axis=1)
    y = np.stack([run[each].values for each in fitted.states], axis=1)
    live, inside = fitted.live(like=run), {"known": [], "not known": []}
    last = len(y) - lead - fitted.lead_samples - 60
    starts = set(np.linspace(fitted.history_samples + 50, last, 40).astype(int).tolist())
    for at in range(last + 1):
        live.step(u[at], y[at])
        if at in starts:
            truth = y[at + 1 : at + lead + 1]
            for words, future in (("known", u[at + 1 :]), ("not known", None)):
                found = live.forecast(lead, future)
                low, high = (
                    np.stack([found[s].sel(statistic=each) for s in fitted.states], axis=1)
                    for each in ("lower", "upper")
                )
                inside[words].append((low <= truth) & (truth <= high))
    for words, each in inside.items():
        over = 100 * np.mean(each, axis=(0, 2))
        parts = f"one step {over[0]:.1f} %, 5 T {over[-1]:.1f} %, all {over.mean():.1f} %"
        print(f"waves {words}: {parts}")


def chain(model, campaign, name, until=120.0):
    """Difference of live and offline samples, and of forecasts that start from them."""
    fitted, read = seakeep.load_model(model), seakeep.read_campaign(campaign)
    offline = read.prepare([name])[name]
    options = read.settings.files.known()
    files = {key: read_columns(path, options).values for key, path in read.files_of(name).items()}
    for delay in DELAYS:
        live, given, at, spent = read.live_chain(name, delay=delay), [], dict.fromkeys(files, 0), []
        for instant in np.arange(4.0, until, 4.0):
            new = {}
            for key, rows in files.items():
                upto = int(np.searchsorted(next(iter(rows.values())), instant))
                new[key] = {column: each[at[key] : upto] for column, each in rows.items()}
                at[key] = upto
            begun = time.process_time()
            given.append(live.push(new))
            spent.append(time.process_time() - begun)
        found = xr.concat([each for each in given if each.sizes["time"]], "time")
        found = found.sel(time=slice(float(offline["time"][0]), None))
        expected = offline.sel(time=found["time"].values, method="nearest")
        found = found.assign_coords(time=expected["time"]).assign_attrs(offline.attrs)
        for each in found.data_vars:
            found[each].attrs = offline[each].attrs
        names = [*fitted.states, *fitted.inputs]
        apart = {s: float((found[s] - expected[s]).std() / expected[s].std()) for s in names}
        steps = round(read.seconds("5 T") / fitted.dt)
        times = expected["time"].values
        starts = times[fitted.history_samples + 20 : -steps - 60 - fitted.lead_samples : 30]
        errors = []
        for source in (expected, found):
            made = fitted.forecast_windows(source, list(starts), steps)
            leads = made["lead"].values
            truth = [offline.sel(time=start + leads, method="nearest") for start in starts]
            ratios = []
            for state in fitted.states:
                apart_by = made[state].values - np.stack([each[state] for each in truth])
                ratios.append(np.sqrt(np.mean(apart_by**2)) / float(offline[state].std()))
            errors.append(float(np.mean(ratios)))
        worst = max(apart, key=apart.__getitem__)
        mean = 100 * np.mean(list(apart.values()))
        print(f"delay {delay}: apart by {mean:.1f} % of the SD, {worst} {100 * apart[worst]:.1f} %")
        print(f"  forecasts over 5 T: NRMSE {errors[0]:.3f} offline, {errors[1]:.3f} live")
        print(f"  {np.median(spent):.2f} s of CPU per 4 s of record")


if __name__ == "__main__":
    {"steps": steps, "bands": bands, "chain": chain}[sys.argv[1]](*sys.argv[2:])
