"""The measurement chain on the virtual tank's raw files, held against the truth.

    python benchmarks/chain_on_tank.py [--out FILE.md]

The irregular runs are played as `seakeep tank` delivers them: four loggers with clocks, rates and
noise of their own. The truth is taken out of the folder and deleted, the runs are prepared by the
campaign file that the tank wrote, and what comes out is compared with the truth over the part of
each run that is used. Beside each channel's error stands its floor: the same noise, drawn again
without any motion, waves or slap, sent through the same chain.
"""

from __future__ import annotations

import argparse
import shutil
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import scipy
import xarray as xr

import seakeep
from seakeep.signals import effective_celerity, encounter_period, peak_period
from seakeep.tank.instruments import record_run
from seakeep.tank.play import check_settings, generator, play, play_run, write_record
from seakeep.tank.seas import Sea
from seakeep.tank.settings import TankSettings, default_settings
from seakeep.waves import phase_speed, wavenumber

MOTIONS = [f"{m}{k}" for m in ("surge", "heave", "pitch") for k in ("", "_rate", "_acceleration")]
PROBES = ("eta_fwd", "eta_cog")
BAND = (0.2, 15.0)  # Hz, in which the tank's campaign integrates surge acceleration
CLOCKS = {"loads": 500.0, "mru": 50.0, "video": 30.0}


@dataclass(frozen=True)
class Delivered:
    """What the tank delivered: its settings, the campaign without the truth, and the truth."""

    settings: TankSettings
    campaign: seakeep.Campaign
    truth: dict[str, xr.Dataset]

    def begin(self, name: str) -> float:
        """Instant at which the waves of a run have grown, s."""
        return self.settings.runs[name].startup


def irregular(settings: TankSettings) -> list[str]:
    """Names of the irregular runs."""
    return [name for name, run in settings.runs.items() if run.spectrum is not None]


def deliver(
    folder: Path, settings: TankSettings | None = None, kind: Literal["csv", "nc"] = "csv"
) -> Delivered:
    """Play the irregular runs into a folder and take the truth out of it."""
    settings = settings or default_settings()
    play(settings, folder, kind=kind, names=irregular(settings))
    truth = {}
    for path in sorted((folder / "truth").iterdir()):
        with xr.open_dataset(path) as opened:
            truth[path.stem] = opened.load()
    shutil.rmtree(folder / "truth")
    return Delivered(settings, seakeep.read_campaign(folder / "campaign.toml"), truth)


def used(run: xr.Dataset) -> xr.Dataset:
    """Part of a prepared run that trains or tests, to the last sample that all loggers have."""
    return run.sel(time=slice(run.attrs["train_span"][0], run.attrs["test_span"][1]))


def true_motions(run: xr.Dataset, truth: xr.Dataset) -> xr.Dataset:
    """True motions at the instants of a prepared run, surge rate in the chain's band."""
    whole, rate = truth[MOTIONS].copy(), truth["surge_rate"]
    step = float(truth["time"][1] - truth["time"][0])
    whole["surge_rate"] = rate.copy(data=seakeep.signals.band_pass(rate.values, step, BAND))
    return whole.interp(time=run["time"], method="cubic")


def errors(run: xr.Dataset, truth: xr.Dataset) -> dict[str, float]:
    """NRMSE of each motion against the truth."""
    part = used(run)
    judged = seakeep.metrics.nrmse(predicted=part[MOTIONS], measured=true_motions(part, truth))
    return {name: float(judged[name]) for name in MOTIONS}


def noise_alone(delivered: Delivered, name: str, folder: Path, period: float) -> xr.Dataset:
    """Prepare a run that holds the very noise of the delivered one, and nothing else."""
    settings = delivered.settings
    played = play_run(settings, name, check_settings(settings, [name]))
    motion = replace(
        played.motion,
        **{key: 0.0 * getattr(played.motion, key) for key in ("position", "velocity")},
        acceleration=0.0 * played.motion.acceleration,
    )
    none = np.zeros(0)
    instruments = settings.instruments.model_copy(update={"slap": {}, "second_order": False})
    still = replace(
        played,
        settings=settings.model_copy(update={"instruments": instruments}),
        sea=Sea(none, none, none, none),
        motion=motion,
    )
    raw = folder / "raw" / name
    raw.mkdir(parents=True, exist_ok=True)
    for logger, record in record_run(still, generator(settings, name, "instruments")).items():
        played_file = next(delivered.campaign.path.parent.glob(f"raw/{name}/{logger}.*"))
        write_record(record, raw / played_file.name)
    text = delivered.campaign.path.read_text(encoding="utf-8")
    stated = text.replace("[campaign]", f"[campaign]\nencounter_period = {period!r}", 1)
    path = folder / "campaign.toml"
    path.write_text(stated.replace("[instruments]", "[instruments]\npool_drift = false", 1))
    return seakeep.read_campaign(path).prepare([name])[name]


def floor(noise: xr.Dataset, run: xr.Dataset, truth: xr.Dataset) -> dict[str, float]:
    """SD of the noise that came through the chain over the SD of the true motion."""
    true = true_motions(used(run), truth)
    part = noise.sel(time=slice(float(true["time"][0]), float(true["time"][-1])))
    return {name: float(part[name].std(ddof=1) / true[name].std(ddof=1)) for name in MOTIONS}


def periods(delivered: Delivered, runs: dict[str, xr.Dataset]) -> tuple[float, float]:
    """Mean encounter period of the campaign, prepared and true (crests included)."""
    probe, crest = "eta_kn_fwd", "eta_kn_fwd_crest"
    true = []
    for name, truth in delivered.truth.items():
        part = truth.sel(time=slice(delivered.begin(name), None))
        true.append(encounter_period((part[probe] + part[crest]).values, 0.01))
    return next(iter(runs.values())).attrs["encounter_period"], float(np.mean(true))


def celerities(delivered: Delivered, name: str, run: xr.Dataset) -> dict[str, tuple[float, float]]:
    """Phase celerity at the peak period, and the effective one, each beside what it should be.

    Linear dispersion for the first; for the second the peak, within the same bounds, of the
    correlation that the true components make.
    """
    part = used(run)
    upstream, downstream = (part[probe].values for probe in PROBES)
    places = [part[probe].attrs["x_position"] for probe in PROBES]
    dt, depth, apart = run.attrs["dt"], run.attrs["water_depth"], places[1] - places[0]
    peak = 1.0 / peak_period(upstream, dt)
    how = {"fs": 1 / dt, "window": "hamming", "nperseg": min(round(60 / dt), upstream.size // 2)}
    frequency, cross = (each[1:] for each in scipy.signal.csd(upstream, downstream, **how))
    expected = wavenumber(2 * np.pi * frequency, depth) * apart  # the nearest turn to it is taken
    turn = expected + np.angle(np.conj(cross) * np.exp(-1j * expected))
    phase = float(np.interp(peak, frequency, 2 * np.pi * frequency * apart / turn))
    found = effective_celerity(upstream, downstream, dt, apart, depth)
    sea = play_run(delivered.settings, name, check_settings(delivered.settings, [name])).sea
    lags = np.linspace(*found.bounds, 4001)
    turned = np.cos(np.outer(lags, sea.omega) - sea.wavenumber * apart)
    true = apart / lags[int(np.argmax((sea.amplitude**2 * turned).sum(axis=1)))]
    return {
        "phase": (phase, float(phase_speed(2 * np.pi * peak, depth))),
        "effective": (found.celerity, float(true)),
    }


def clocks(run: xr.Dataset, truth: xr.Dataset) -> dict[str, tuple[float, float]]:
    """Error of each clock's offset (s) and drift (ppm)."""
    keys = ("offset", "drift_ppm")
    return {
        name: tuple(
            float(run.attrs[f"clock_{name}_{key}"] - truth.attrs[f"clock_{name}_{key}"])
            for key in keys
        )
        for name in CLOCKS
    }


def report(folder: Path) -> str:
    """Text of all tables."""
    delivered = deliver(folder / "tank")
    runs = delivered.campaign.prepare()
    lines = ["# The measurement chain against the truth", ""]
    lines += [
        "Made by `python benchmarks/chain_on_tank.py`: the irregular runs of the virtual tank,"
    ]
    lines += ["raw files of four loggers, prepared as the tank's campaign file says.", ""]
    lines += ["NRMSE of each motion, and beside it the floor: the stated noise alone through the"]
    lines += ["same chain, over the same SD. Asked for: 0.05, or 1.2 times the floor. Surge rate"]
    lines += ["is integrated from acceleration: it is held against the truth in that band, 0.2 to"]
    lines += ["15 Hz.", ""]
    lines += ["| motion | " + " | ".join(runs) + " |", "|---|" + "---|" * len(runs)]
    judged = {name: errors(run, delivered.truth[name]) for name, run in runs.items()}
    period, true_period = periods(delivered, runs)
    floors = {}
    for name, run in runs.items():
        noise = noise_alone(delivered, name, folder / f"noise_{name}", period)
        floors[name] = floor(noise, run, delivered.truth[name])
    for motion in MOTIONS:
        cells = [f"{judged[name][motion]:.4f} ({floors[name][motion]:.4f})" for name in runs]
        lines.append(f"| {motion} | " + " | ".join(cells) + " |")
    lines += ["", f"Encounter period {period:.4f} s; true {true_period:.4f} s.", ""]
    lines += ["| run | phase celerity at T_p, dispersion (m/s) | effective, true sea's (m/s) |"]
    lines += ["|---|---|---|"]
    for name, run in runs.items():
        both = celerities(delivered, name, run)
        cells = [f"{got:.3f}, {true:.3f} ({got / true - 1:+.1%})" for got, true in both.values()]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    lines += ["", "| run | clock | offset off by | drift off by | as stated on the sheet |"]
    lines += ["|---|---|---|---|---|"]
    for name, run in runs.items():
        for clock, (offset, drift) in clocks(run, delivered.truth[name]).items():
            stated = run.attrs[f"clock_{clock}"]
            lines.append(
                f"| {name} | {clock} | {1e3 * offset:+.3f} ms | {drift:+.2f} ppm | {stated} |"
            )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the tables, and write them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    place = Path(__file__).parent / "results" / "chain_on_tank.md"
    parser.add_argument("--out", type=Path, default=place, help="file for the tables")
    out = parser.parse_args().out
    with tempfile.TemporaryDirectory() as folder:
        text = report(Path(folder))
    print(text)
    out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
