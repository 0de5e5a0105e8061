"""Play a measured run to a model sample by sample: a tenth of the samples is lost, a sensor dies.

    seakeep fit docs/tutorial/campaign.toml -o model.nc
    python examples/in_service/play.py model.nc docs/tutorial/campaign.toml unseen heave played.png

The figure shows the estimate with its 95 % band, the measurement that the model was not given, and
forecasts of the last 20 s of the minute in which the sensor is dead, without waves to come.
"""

import sys

import numpy as np
from matplotlib.figure import Figure

import seakeep
from seakeep.campaign import load_prepared

LOST = 0.1
DEAD = 60.0  # s
FORECASTS = (20.0, 10.0)  # s before the sensor is back, and the longest lead


def play(model, run, channel, seed=0):
    """Feed the run with losses: estimates, their deviations, when it was dead, and forecasts."""
    rng = np.random.default_rng(seed)
    time = run["time"].values
    u = np.stack([run[name].values for name in model.inputs], axis=1)
    y = np.stack([run[name].values for name in model.states], axis=1)
    column = model.states.index(channel)
    dead = (time >= time.mean() - DEAD / 2) & (time < time.mean() + DEAD / 2)
    y[dead, column] = np.nan
    lost = rng.uniform(size=time.size) < LOST
    lost[: model.history_samples] = False
    starts = np.searchsorted(time, time[dead][-1] - FORECASTS[0] * np.array([1.0, 0.5, 0.0]))
    steps = round(FORECASTS[1] / model.dt)

    live = model.live(like=run)
    estimates, deviations, forecasts = np.empty(time.size), np.empty(time.size), []
    for at in range(time.size):
        # A lost sample has neither waves nor states: the waves are predicted from those before.
        state = live.step() if lost[at] else live.step(u[at], y[at])
        estimates[at] = state[column]
        deviations[at] = np.sqrt(live.covariance[column, column])
        if at in starts:
            forecasts.append(live.forecast(steps)[channel])
    return estimates, deviations, dead, forecasts


def draw(run, channel, estimates, deviations, dead, forecasts):
    """Estimate, band and forecasts around the time in which the sensor is dead."""
    time, measured = run["time"].values, run[channel]
    figure = Figure(figsize=(9.0, 5.2), layout="constrained")
    panels = figure.subplots(2, 1)
    begin, end = time[dead][[0, -1]]
    spans = ((begin - 8, end + 8), (end - FORECASTS[0] - 2, end + FORECASTS[1]))
    for axes, span in zip(panels, spans, strict=True):
        axes.axvspan(begin, end, color="0.92", label="sensor dead")
        axes.plot(time, measured, color="black", lw=0.9, label="measured, not given while dead")
        low, high = estimates - 1.96 * deviations, estimates + 1.96 * deviations
        axes.fill_between(time, low, high, color="#0072B2", alpha=0.3, lw=0, label="95 % band")
        axes.plot(time, estimates, color="#0072B2", lw=1.1, ls="--", label="estimate")
        axes.set_xlim(*span)
        axes.set_ylabel(f"{channel} [{measured.attrs['units']}]")
    for number, forecast in enumerate(forecasts):
        lower, upper = (forecast.sel(statistic=each) for each in ("lower", "upper"))
        leads = forecast["time"].values
        words = {"label": "forecast and its band"} if number == 0 else {}
        panels[1].fill_between(leads, lower, upper, color="#D55E00", alpha=0.15, lw=0)
        panels[1].plot(leads, forecast.sel(statistic="mean"), color="#D55E00", lw=1.1, **words)
    panels[1].set_xlabel("time [s]")
    handles, words = panels[1].get_legend_handles_labels()
    figure.legend(handles, words, loc="outside upper center", ncols=5, fontsize=8)
    return figure


def main(model, campaign, name, channel, out):
    """Play a run of a campaign, print what came of it, and write the figure."""
    fitted, read = seakeep.load_model(model), seakeep.read_campaign(campaign)
    run = load_prepared(read, names=[name])[name]
    played = play(fitted, run, channel)
    estimates, deviations, dead, _ = played
    error = (estimates - run[channel].values)[dead]
    inside = np.mean(np.abs(error) <= 1.96 * deviations[dead])
    share = np.sqrt(np.mean(error**2)) / float(run[channel].std())
    print(f"{channel} while its sensor is dead: error {share:.2f} SD, {inside:.0%} in the band")
    draw(run, channel, *played).savefig(out, dpi=110)


if __name__ == "__main__":
    main(*sys.argv[1:])
