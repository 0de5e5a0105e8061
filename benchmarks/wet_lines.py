"""What reading loads off the wave at their lines gains where lines feel it: stand-in tanks.

The lines of the virtual tank do not feel the wave. Here each of them bears a further load of known
form, 1.9 m up-wave (bow) and 2.6 m down-wave (stern) of the vessel at rest, where the elevation e
in standard deviations wets it:

    w = clip((e + 0.5) / 1, 0, 1),    load = 0.3 SD (w e + 0.5 |e'| e' w)

with e' its rate, in standard deviations too, and SD that of the measured load. The elevation is
that of `eta_cog`, carried by dispersion as a whole record, not by the carriers of the model. Models
of two irregular runs forecast the third, in windows of 15 encounter periods; models of all three
forecast a regular run, in windows of 5.

    OPENBLAS_NUM_THREADS=1 python benchmarks/wet_lines.py [--seeds 0 23 71] [--work DIR] [--out F]
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from alignment_on_tank import INPUTS, STATES
from skill import markdown

import seakeep
from seakeep.models.settings import periods_to_samples
from seakeep.signals.propagation import carry_by_dispersion
from seakeep.tank.play import play
from seakeep.tank.settings import default_settings, with_waves

PLACES = {"mooring_bow": -1.9, "mooring_stern": 2.6}
PART = 0.3
KINDS = {"as states": (), "chosen": "auto"}
REGULAR = "regular_1_5"


def wet(run):
    """A run whose lines feel the wave."""
    dt, depth = run.attrs["dt"], run.attrs["water_depth"]
    out = run.copy()
    for name, place in PLACES.items():
        eta = run["eta_cog"].values
        carrier = carry_by_dispersion(eta, dt, (place, place), depth)
        wave = carrier.at(np.full(eta.size, place))[:, 0]
        rate = np.gradient(wave, dt)
        e, d = wave / wave.std(), rate / rate.std()
        part = np.clip(e + 0.5, 0.0, 1.0)
        more = PART * float(run[name].std()) * (part * e + 0.5 * np.abs(d) * d * part)
        out[name] = run[name] + more
        out[name].attrs = run[name].attrs
    return out


def errors(model, run, period, length):
    """NRMSE over (window, state) of forecasts end to end."""
    steps, before, ahead = (periods_to_samples(n, period, model.dt) for n in (length, 10, 3))
    time = run["time"].values
    rows = []
    for at in range(before, time.size - steps - ahead, steps):
        forecast = model.forecast(run, start=float(time[at]), steps=steps)
        measured = run[STATES].sel(time=forecast["time"])
        each = seakeep.metrics.nrmse(predicted=forecast, measured=measured)
        rows.append([float(each[state]) for state in STATES])
    return np.array(rows)


def rows_of(seed, work):
    """Rows of a stand-in tank."""
    folder = work / f"seed_{seed}_newman"
    if not (folder / "campaign.toml").exists():
        play(with_waves(default_settings(), seed, "jittered"), folder)
    campaign = seakeep.read_campaign(folder / "campaign.toml")
    names = [each for each in campaign.settings.runs if each.startswith("irregular")]
    prepared = campaign.prepare([*names, REGULAR])
    begin = prepared[names[0]].attrs["train_span"][0]
    runs = {name: wet(run.sel(time=slice(begin, None))) for name, run in prepared.items()}
    period = campaign.encounter_period()
    spec = seakeep.HankelDMDc.recommended(period, runs[names[0]].attrs["dt"])
    found = {kind: [[], []] for kind in KINDS}
    kinds = []
    for left in (*names, REGULAR):
        training = {name: runs[name] for name in names if name != left}
        settled = replace(spec, readouts=()).fit(training, STATES, INPUTS).settings
        for kind, readouts in KINDS.items():
            model = replace(settled, readouts=readouts).fit(training, STATES, INPUTS)
            is_regular = left == REGULAR
            length = 5 if is_regular else 15
            found[kind][is_regular].append(errors(model, runs[left], period, length))
        kinds += [each.kind for each in model.signature.readouts]
    rows = []
    for kind, parts in found.items():
        irregular, regular = (np.concatenate(each) for each in parts)
        loads = [float(np.median(irregular[:, STATES.index(name)])) for name in PLACES]
        averages = [float(np.median(np.nanmean(each, axis=1))) for each in (irregular, regular)]
        rows.append([str(seed), kind, *(f"{v:.3f}" for v in (averages[0], *loads, averages[1]))])
    rows[1][1] += f" (wave: {kinds.count('wave')} of {len(kinds)})"
    return rows


def main():
    """Print the table, and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 23, 71])
    parser.add_argument("--work", type=Path, help="folder of tanks that were played")
    place = Path(__file__).parent / "results" / "wet_lines.md"
    parser.add_argument("--out", type=Path, default=place, help="file for the table")
    asked = parser.parse_args()
    warnings.simplefilter("ignore", seakeep.SeakeepWarning)
    with tempfile.TemporaryDirectory() as temporary:
        rows = [row for seed in asked.seeds for row in rows_of(seed, asked.work or Path(temporary))]
    heads = ("seed", "loads", "ANRMSE, 15 T̂", "bow", "stern", "ANRMSE, λ/L 1.5, 5 T̂")
    text = "\n".join(
        [
            "# Loads by the wave at their lines",
            "",
            f"Made by `python benchmarks/wet_lines.py` with seakeep {seakeep.__version__}: tanks "
            "whose lines feel the wave by a load of known form. Medians over the windows, in "
            "SD of the window.",
            "",
            *markdown(heads, rows),
        ]
    )
    print(text)
    asked.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
