"""What a model in service costs, and what it gives up: steps, bands, and the chain of raw samples.

python benchmarks/live.py steps [COUNT]                  # time and memory of COUNT steps
python benchmarks/live.py service CAMPAIGN.toml                   # what `recommended` costs
python benchmarks/live.py bands CAMPAIGN.toml [KIND [STARTS]]     # errors and bands; KIND of SPECS
python benchmarks/live.py higher CAMPAIGN.toml HIGHER.toml        # bands in seas that did not train
python benchmarks/live.py lost CAMPAIGN.toml                      # filling of lost samples of waves
python benchmarks/live.py outage CAMPAIGN.toml [KIND [STARTS]]    # forecasts after lost samples
python benchmarks/live.py chain MODEL.nc CAMPAIGN.toml RUN    # live chain against the offline one
"""

import copy
import resource
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

import seakeep
from seakeep.campaign import load_prepared
from seakeep.formats import read_columns
from seakeep.signals.prediction import foresee, predict_waves

TUTORIAL = Path(__file__).parents[1] / "docs" / "tutorial" / "campaign.toml"
LEADS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0)
"""Leads of the table in encounter periods; the first is one step."""
SPECS = {
    "plain": lambda period, dt: seakeep.HankelDMDc(
        round(period / dt), round(3 * period / dt), ridge=30.0
    ),
    "recommended": seakeep.HankelDMDc.recommended,
    "ensemble": lambda period, dt: seakeep.BayesianHankelDMDc(
        encounter_period=period,
        window=None,
        state_delays=seakeep.Uniform("0.5 T", "1.5 T"),
        input_delays=seakeep.Uniform("2 T", "4 T"),
        ridge=seakeep.Uniform(10, 90),
        n_members=20,
        dt=dt,
    ),
}
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


def service(campaign):
    """Time of the recommended model of two runs, served in the third: ms of CPU.

    Complete samples are judged sixteen at a time, so that theirs is a mean.
    """
    read = seakeep.read_campaign(campaign)
    names, channels = read.training_runs, read.model()
    runs = load_prepared(read, names=names)
    run, dt = runs[names[-1]], float(runs[names[0]].attrs["dt"])
    spec = seakeep.HankelDMDc.recommended(read.seconds("1 T"), dt)
    begun = time.process_time()
    others = [runs[each] for each in names]
    spec.fit(others, list(channels.states), list(channels.inputs))
    print(f"choice and fit, {len(others)} runs: {time.process_time() - begun:.1f} s")
    model = spec.fit(others[:-1], list(channels.states), list(channels.inputs))
    u = np.stack([run[each].values for each in model.inputs], axis=1)
    y = np.stack([run[each].values for each in model.states], axis=1)
    live, at = model.live(like=run), 1500
    for number in range(at + 1):
        live.step(u[number], y[number])
    dead = y.copy()
    dead[:, 0] = np.nan

    def step(inputs, states):
        nonlocal at
        at += 1
        return live.step(inputs[at] if inputs is not None else None, states[at])

    def complete():
        return step(u, y)

    calls = {
        "forecast of 15 T": lambda: model.forecast(run, float(run.time[at]), 15 * 32),
        "blind forecast of 10 s with band": lambda: live.forecast(round(10 / dt)),
        "complete step": complete,
        "step with a dead sensor": lambda: step(u, dead),
        "lost sample": lambda: step(None, np.full_like(y, np.nan)),
    }
    for words, call in calls.items():
        spent = []
        for _ in range(320 if call is complete else 20):
            begun = time.process_time()
            call()
            spent.append(1e3 * (time.process_time() - begun))
        middle = np.mean(spent) if call is complete else np.median(spent)
        print(f"{words}: {middle:.2f} ms, at most {max(spent):.2f} ms")


def bands(campaign, kind="plain", starts=60):
    """Errors of forecasts and what 95 % bands hold: each training run held out once, and played.

    The waves after a start are known; or predicted, with what the probe up-wave has seen; or
    predicted from each probe's own record.
    """
    read = seakeep.read_campaign(campaign)
    names, channels = read.training_runs, read.model()
    runs = load_prepared(read, names=names)
    dt = float(runs[names[0]].attrs["dt"])
    period = read.seconds("1 T")
    leads = [max(round(each * period / dt), 1) - 1 for each in LEADS]
    found = {}
    for name in names:
        others = [runs[each] for each in names if each != name]
        fitted = SPECS[kind](period, dt).fit(others, list(channels.states), list(channels.inputs))
        model = fitted.hold() if hasattr(fitted, "hold") else fitted
        for words, each in _served(model, runs[name], leads[-1] + 1, int(starts)).items():
            found.setdefault(words, []).append(each)
    print("lead, T:", *LEADS)
    for words, each in found.items():
        error, inside = np.mean(each, axis=0)
        of_leads = " ".join(f"{error[lead]:.2f}" for lead in leads)
        print(f"{words}: error, training SD: {of_leads}; largest {error.max():.2f}")
        covered = " ".join(f"{100 * inside[lead]:.1f}" for lead in leads)
        apart = ", ".join(f"{100 * run[1].mean():.1f}" for run in each)
        print(f"  in the band, %: {covered}; all {100 * inside.mean():.1f}, of runs {apart}")


def _served(model, run, steps, starts):
    """Mean over channels of the error and of what the band holds, by lead, shape (2, steps)."""
    u = np.stack([run[each].values for each in model.signature.inputs], axis=1)
    y = np.stack([run[each].values for each in model.signature.states], axis=1)
    placed, alone = model.live(like=run), model.live(like=run)
    alone._foreseen = partial(alone._foreseen, positions=np.nan)  # as if none were known
    lives = {"known": placed, "probe up-wave": placed, "each probe alone": alone}
    sums = {words: np.zeros((2, steps, y.shape[1])) for words in lives}
    last = len(y) - steps - model.signature.lead_samples - 60
    begins = np.linspace(model.signature.history_samples + 50, last, starts).astype(int)
    for at in range(last + 1):
        for live in set(lives.values()):
            live.step(u[at], y[at])
        for words, live in lives.items() if at in begins else ():
            made = live.forecast(steps, u[at + 1 :] if words == "known" else None)
            values = np.stack([made[each].values for each in model.signature.states], axis=-1)
            truth = y[at + 1 : at + steps + 1]
            sums[words][0] += (values[0] - truth) ** 2
            sums[words][1] += (values[2] <= truth) & (truth <= values[3])
    spread = model.signature.state_scale.spread
    return {
        words: (np.mean(np.sqrt(error / starts) / spread, axis=1), np.mean(inside / starts, axis=1))
        for words, (error, inside) in sums.items()
    }


def higher(campaign, other, name="irregular_3"):
    """What 95 % bands hold over 5 T in a run of another campaign, widened and as in training."""
    read = seakeep.read_campaign(campaign)
    trained = [each for each in read.training_runs if each != name]
    runs, channels = load_prepared(read, names=trained), read.model()
    run = load_prepared(seakeep.read_campaign(other), names=[name])[name]
    dt, period = float(run.attrs["dt"]), read.seconds("1 T")
    spec = SPECS["plain"](period, dt)
    model = spec.fit(runs, list(channels.states), list(channels.inputs))
    u, y = (np.stack([run[each].values for each in of], 1) for of in (model.inputs, model.states))
    live, steps, inside, trusted = model.live(like=run), round(5 * period / dt), [], []
    for at in range(len(y) - steps - model.lead_samples):
        live.step(u[at], y[at])
        if at < 900 or at % 90:
            continue
        made = live.forecast(steps, u[at + 1 :])
        mean, std, lower, upper = np.stack([made[each].values for each in model.states], axis=-1)
        truth = y[at + 1 : at + steps + 1]
        inside.append((lower <= truth) & (truth <= upper))
        factor = model.errors.of_forecast(steps) ** 0.5 / std
        trusted.append(np.abs(truth - mean) <= factor * (upper - mean))
    print(f"{made.attrs['validity']}: {100 * np.mean(inside):.0f} % in the band, and")
    print(f"{100 * np.mean(trusted):.0f} % if it were as in training; {len(inside)} forecasts")


def lost(campaign, gaps=100):
    """Errors in gaps of waves that are filled from each record, or from the probe up-wave too."""
    read = seakeep.read_campaign(campaign)
    name, names = read.training_runs[0], list(read.model().inputs)
    run = load_prepared(read, names=[name])[name]
    u = np.stack([run[each].values for each in names], axis=1)
    rig = {"dt": float(run.attrs["dt"]), "depth": float(run.attrs["water_depth"])}
    rig["positions"] = [run[each].attrs["x_position"] for each in names]
    fills = {
        "own record": lambda record, count: predict_waves(record, count),
        "up-wave": lambda record, count: foresee(record, count, **rig).expected,
    }
    for words, fill in fills.items():
        begun, apart = time.process_time(), []
        for at in np.linspace(1600, len(u) - 40, int(gaps)).astype(int):
            apart.append(fill(u[at - 1552 : at], 16) - u[at : at + 16])
        spent = 1e3 * (time.process_time() - begun) / int(gaps)
        error = np.sqrt(np.mean(np.square(apart), axis=0)) / u.std(axis=0)
        print(f"{words}: SD at 1 and 16 samples {error[[0, -1]].round(3).tolist()}, {spent:.0f} ms")


OUTAGES = {
    "nothing": (0, 0, False),
    "2 samples": (2, 0, False),
    "20 samples": (20, 0, False),
    "40 samples": (40, 0, False),
    "80 samples": (80, 0, False),
    "80 samples of waves": (80, 0, True),
    "40 samples, then 20 of waves": (40, 20, False),
}
"""Samples without waves, then with them; and whether states are measured in the first ones."""


def outage(campaign, kind="recommended", starts=40):
    """Errors and bands of forecasts after lost samples, in a run by a model of the others."""
    read = seakeep.read_campaign(campaign)
    names, channels = read.training_runs, read.model()
    runs = load_prepared(read, names=names)
    run, period = runs[names[-1]], read.seconds("1 T")
    dt = float(run.attrs["dt"])
    model = SPECS[kind](period, dt).fit(
        [runs[each] for each in names[:-1]], list(channels.states), list(channels.inputs)
    )
    u = np.stack([run[each].values for each in model.signature.inputs], axis=1)
    y = np.stack([run[each].values for each in model.signature.states], axis=1)
    steps, spread = round(3 * period / dt), model.signature.state_scale.spread
    leads = [max(round(each * period / dt), 1) - 1 for each in LEADS if each <= 3]
    begins = np.linspace(model.signature.history_samples + 400, len(u) - steps - 130, int(starts))
    holes = np.random.default_rng(0).random(len(u)) < 0.1
    holes[:8] = False
    found = {words: [] for words in (*OUTAGES, "a tenth of all samples")}

    def judge(words, live, at):
        made = live.forecast(steps)
        values = np.stack([made[each].values for each in model.signature.states], axis=-1)
        truth = y[at + 1 : at + 1 + steps]
        inside = (values[2] <= truth) & (truth <= values[3])
        found[words].append([((values[0] - truth) / spread) ** 2, inside])

    whole, holed = (model.live(like=run) for _ in range(2))
    for at in range(int(begins.max()) + 1):
        whole.step(u[at], y[at])
        gone = holes[at]
        holed.step(None if gone else u[at], None if gone else y[at])
        if at in begins.astype(int):
            judge("a tenth of all samples", holed, at)
            for words, (dark, light, is_seen) in OUTAGES.items():
                live = copy.deepcopy(whole, {id(model): model})
                for later in range(at + 1, at + 1 + dark + light):
                    is_dark = later <= at + dark
                    live.step(None if is_dark else u[later], y[later] if is_seen else None)
                judge(words, live, at + dark + light)
    print("lost | error, training SD, at T:", *LEADS[: len(leads)], "| in the band")
    for words, each in found.items():
        squares, inside = np.mean(each, axis=0)
        error = np.sqrt(squares.mean(axis=1))
        print(words, "|", *error[leads].round(2), f"| {100 * inside.mean():.0f} %")


def chain(model, campaign, name, until=120.0):
    """Difference of live and offline samples, and of forecasts that start from them."""
    fitted, read = seakeep.load_model(model), seakeep.read_campaign(campaign)
    offline = read.prepare([name])[name]
    options = read.settings.files
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
    calls = (steps, service, bands, higher, lost, outage, chain)
    {each.__name__: each for each in calls}[sys.argv[1]](*sys.argv[2:])
