"""Comparisons and forecasts as tables: blocks for the terminal, CSV with all digits.

Table of the margins of a calibrated band.
"""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from seakeep.arrays import Datasets, FloatArray
from seakeep.conventions import displayed
from seakeep.files import MARK, write_netcdf, write_text
from seakeep.models import HankelEnsemble
from seakeep.models.forecasts import counted
from seakeep.report.tables import (
    WORDS,
    Number,
    Table,
    band_verdict,
    band_words,
    by_channel,
    entries,
    interval,
    number,
    numbers,
    plain_cell,
    ratio_of,
    row,
    short,
    shorter,
    table,
    write_frame,
)

UNTIL = "waves read until [s]"
"""Column of a forecast's CSV file where the model looks ahead."""
HEADER = "model,run,channel,lead,error,claimed,coverage,lead_time"
"""First line of the CSV file of models in service."""


def comparison_blocks(table: xr.Dataset) -> Iterator[Table]:
    """Comparison of forecasts with measurements, tables per run that fit a terminal."""
    for at in entries(table, "run"):
        title = f"forecast against measurement{_scale_words(at)}"
        if "level" in at:
            title += f", {band_words(at['level'].item(), at['band'].item())}"
        columns = [
            [head, *numbers(at[key], digits), number(at[mean], digits) if mean else ""]
            for key, (head, digits, mean) in WORDS["comparison"].items()
            if key in at
        ]
        yield _by_channel(at, "comparison", title, columns, _note(at))
        bounds = [
            [
                f"{key.upper()}, 95 %",
                *(interval(one, key) for one in entries(at, "channel")),
                interval(at, mean),
            ]
            for key, mean in (("nrmse", "anrmse"), ("nammae", "mean_nammae"))
        ]
        yield _by_channel(at, "intervals", "intervals over blocks of the forecast", bounds)
        yield _extremes(at, "extremes")


def _scale_words(table: xr.Dataset) -> str:
    """Scale for a title; nothing at model scale."""
    if "scale_factor" not in table:
        return ""
    return f", full scale (1:{float(table['scale_factor'].max()):g})"


def _by_channel(
    at: xr.Dataset, name: str, title: str, columns: Iterable[Iterable[str]], note: str = ""
) -> Table:
    """A row per channel of a run, and one of averages where columns have it; headings first."""
    run, parts = at["run"].item(), by_channel(at["channel"].values, columns)
    return Table(f"{name}_{run}", f"{run}: {title}", note=note, **parts)


def _extremes(at: xr.Dataset, title: str) -> Table:
    columns = [
        ["unit", *map(str, at["channel_units"].values)],
        *([head, *map(short, at[key])] for key, head in WORDS["extremes"].items() if key in at),
    ]
    return _by_channel(at, "extremes", f"{title}{_scale_words(at)}", columns)


def _note(at: xr.Dataset) -> str:
    keys = ("slack_channels", "probe_offset", "probe_offset_spread", "look_ahead")
    slack, offset, spread, ahead = (at[key].item() for key in keys)
    condition, status = row(at, "conditional_on", "status")
    known = f" ± {spread:.2g}" if np.isfinite(spread) else ""
    said = (
        f"{slack:.0f} still channel{'s' * (slack > 1)} left out of the average" * (slack > 0),
        status * (status != "ok"),
        f"conditional on measured {condition}" * bool(condition),
        look_ahead_words(ahead),
        f"probe offset {offset:.3g}{known} m" * bool(np.isfinite(offset)),
    )
    return "; ".join(filter(None, said))


def model_blocks(tables: Datasets) -> Iterator[Table]:
    """Several models beside each other, a table of averages and one of channels per run."""
    name, first = next(iter(tables.items()))
    for run in first["run"].values:
        models = {model: each.sel(run=run) for model, each in tables.items()}
        said = [f"{m}: {at['status'].item()}" for m, at in models.items() if at["status"] != "ok"]
        ahead = {m: look_ahead_words(float(at["look_ahead"])) for m, at in models.items()}
        said += [f"{model} {words}" for model, words in ahead.items() if words]
        rows = [at.assign(model=model) for model, at in models.items()]
        given = {"name": f"models_{run}", "run": run, "scale": _scale_words(first)}
        yield table("models_of_run", rows, "; ".join(said), **given)
        errors = ([model, *numbers(at["nrmse"])] for model, at in models.items())
        yield _by_channel(models[name], "channels", "NRMSE", errors)
        yield _extremes(models[name], f"extremes of {name}")


def difference_blocks(differences: xr.Dataset) -> Iterator[Table]:
    """Errors of several models run by run, and over all runs their change from the first one."""
    models, runs = (differences[key].values.tolist() for key in ("model", "run"))
    of = runs[0]
    if len(runs) > 1:
        of = f"{len(runs)} runs"
        rows = [
            (*row(at, "run", wave_period=shorter), *numbers(at["anrmse"]))
            for at in entries(differences.sortby("wave_period"), "run")
        ]
        rows.append(("mean", "", *numbers(differences["all_anrmse"])))
        heads, scale = ("run", "waves, s", *models), _scale_words(differences)
        yield table("by_run", rows, columns=heads, averages=[len(runs)], of=of, scale=scale)
    changes: list[tuple[str, ...]] = []
    for at in entries(differences, "model"):
        cells = ratio_of(at, "all_").cells() if changes else ("", "", "")
        changes.append((*row(at, "model", all_anrmse=3), *cells))
    yield table("changes", changes, name="differences", of=of, first=models[0])


def winner(table: xr.Dataset, baselines: Mapping[str, str]) -> str:
    """Which model errs least over all runs, and how to get it where it was fitted as a baseline.

    The table is that of :func:`seakeep.study.difference_table`; `baselines` are kinds by name.
    """
    if not np.isfinite(table["all_anrmse"]).any():
        return "No model could be judged."
    first, ordered = table["model"].values[0], table.sortby("all_anrmse")  # not judged: last
    ratios = {at["model"].item(): ratio_of(at, "all_").cells() for at in entries(ordered, "model")}
    name = next(iter(ratios))
    said = f"Least error: {name}, ANRMSE {number(table['all_anrmse'].min())}"
    if name != first:
        better = next((key for key, (*_, word) in ratios.items() if word == "better"), None)
        for key in dict.fromkeys((name, better or name)):
            value, bounds, _ = ratios[key]
            said += f"; surely better: {key}" if key != name else ""
            said += f", {value} [{bounds}] from {first}"
        if better is None:
            return f"{said}: no model is surely better. Keep {first}."
        name = better
    if kind := baselines.get(name):
        said += (
            f". To use it, give the campaign file a table [models.{kind}] with kind = '{kind}' and "
            f"the lead, alignment and observables of {first}, and run seakeep fit with --model "
            f"{kind}"
        )
    return f"{said}."


def write_differences(table: xr.Dataset, path: Path) -> Path:
    """Write errors of several models as CSV, a row per run and model, and per model for all."""
    of_all = {name: str(name)[4:] for name in table.data_vars if str(name).startswith("all_")}
    every = table[[*of_all]].rename(of_all).expand_dims(run=[""])
    each = table.drop_vars(of_all)
    frames = [part.to_dataframe().reset_index() for part in (each, every)]
    return _write(pd.concat(frames), ["run", "wave_period", "model"], path)


def write_comparison(tables: Datasets, path: Path) -> Path:
    """Write comparison tables as CSV, a row per run and channel, full precision."""
    ordered = {name: table.transpose("run", "channel") for name, table in tables.items()}
    return _write(_below(ordered), ["run", "channel", "channel_units", "model"], path)


def write_nowcasts(nowcasts: Datasets, path: Path) -> Path:
    """Write all errors as CSV, a row per model, run, channel and lead, full precision."""
    keys = HEADER.split(",")
    return _write(_below({name: each[keys[4:]] for name, each in nowcasts.items()}), keys, path)


def _below(tables: Datasets) -> pd.DataFrame:
    """Tables of several models below each other; a column says which."""
    frames = {name: each.to_dataframe() for name, each in tables.items()}
    return pd.concat(frames, names=["model"]).reset_index()


def _write(table: pd.DataFrame, front: list[str], path: Path) -> Path:
    """Write a table as CSV, some of its columns first."""
    return write_frame(table[[*front, *table.columns.difference(front, sort=False)]], path)


def nowcast_blocks(nowcasts: Datasets) -> Iterator[Table]:
    """Lead times and errors per channel in service, a table per model and run."""
    for model, of_model in nowcasts.items():
        share, lead = of_model.attrs["share"], of_model["lead"].values
        places = [max(round(len(lead) * part) - 1, 0) for part in (0.05, 0.2, 0.5, 1.0)]
        note = (
            f"errors in training SD over {of_model.attrs['starts']} forecasts, no wave after "
            f"a start known; lead time: error below {share:g} SD"
        )
        most, end = Number(f"at least {number(lead[-1])}"), lead[-1] - 1e-9
        for at in entries(of_model, "run"):
            columns = [
                ["lead time s", *(most if t >= end else number(t) for t in at["lead_time"])],
                *([f"at {number(lead[k])} s", *numbers(at["error"].isel(lead=k))] for k in places),
                ["in band %", *numbers(at["coverage"].mean("lead"), 0)],
            ]
            yield _by_channel(at, f"nowcast_{model}", f"{model} in service", columns, note)


def band_findings(table: xr.Dataset) -> list[str]:
    """Sentences on the bands of an ensemble, one per run; none for a single model."""
    said = []
    for run in table["run"].values if "coverage" in table else ():
        at = table.sel(run=run)
        inside, lost, members = (float(at[k]) for k in ("mean_coverage", "diverged", "members"))
        left_out = f"; {lost:.0f} of {members:.0f} members diverged and are left out" * (lost > 0)
        if not np.isfinite(inside):
            said.append(f"{run}: there is no band to judge{left_out}.")
            continue
        level, band = at["level"].item(), at["band"].item()
        least = at["coverage"].isel(channel=int(at["coverage"].argmin("channel")))
        words = band_verdict(inside / 100, level)
        if (of_least := band_verdict(float(least) / 100, level)) != words:
            words += f" ({least:.0f} % of {least['channel'].item()}, {of_least})"
        said.append(
            f"{run}: the {band_words(level, band)} of {members - lost:.0f} members holds "
            f"{inside:.0f} % of the measured instants, {words}. {_CARRIES[band]}{left_out}."
        )
    return said


_CARRIES = {
    "members": "It carries the spread of the members, and no noise or model error",
    "calibrated": "It carries the errors of the sea and the horizon that it was calibrated on",
}


def forecast_header(states: Sequence[str]) -> str:
    """Pattern of the start of a CSV file that :func:`write_forecast` writes.

    Measurements have such headers too: ours alone end in CR LF, and their rows in LF.
    """
    one = rf"'?({'|'.join(map(re.escape, states))})( (std|lower|upper|member \d+))? \[[^]]*\]"
    return rf'time \[s\](,"?{one}"?)+(,{re.escape(UNTIL)})?(,scale_factor)?\r\n[^\r\n]*\n'


def look_ahead_words(seconds: float) -> str:
    """How far a forecast reads the inputs, as a clause; empty without a look-ahead."""
    return f"reads the inputs up to {seconds:.3g} s after each instant" if seconds > 0.0 else ""


def write_forecast(forecast: xr.Dataset, path: Path) -> Path:
    """Write a forecast as NetCDF, or as CSV with a column per channel, full precision."""
    if path.suffix == ".nc":
        write_netcdf(path, forecast.assign_attrs({MARK: "forecast"}))
        return path
    # Instants are multiples of a step; nine decimals hide the rounding of the product.
    time = pd.Index(forecast["time"].values.round(9), name="time [s]")
    text = pd.DataFrame(_columns(forecast), index=time).to_csv(lineterminator="\n")
    write_text(path, text.replace("\n", "\r\n", 1))
    return path


def _columns(forecast: xr.Dataset) -> dict[str, FloatArray]:
    dim = next((each for each in ("statistic", "member") if each in forecast.dims), None)
    parts, kind = {"": forecast}, "member " * (dim == "member")
    if dim:
        places = forecast[dim].values
        parts = {f" {kind}{p}".removesuffix(" mean"): forecast.sel({dim: p}) for p in places}
    columns = {
        plain_cell(f"{name}{words} [{variable.attrs.get('units', '')}]"): part[name].values
        for name, variable in forecast.data_vars.items()
        if "time" in variable.dims
        for words, part in parts.items()
    }
    if (ahead := forecast.attrs.get("reads_input_until", 0.0)) > 0.0:
        columns[UNTIL] = (forecast["time"].values + ahead).round(9)
    if forecast.attrs.get("scale") == "full":
        columns["scale_factor"] = np.full(forecast.sizes["time"], forecast.attrs["scale_factor"])
    return columns


def forecast_words(forecast: xr.Dataset) -> str:
    """What a forecast of an ensemble holds, for a message; empty for a single model's."""
    if "statistic" in forecast.dims:
        attrs = forecast.attrs
        count = attrs["members"] - attrs["diverged"]
        words = band_words(attrs["level"], attrs.get("band"))
        return f"mean, std and {words} of {count} members at "
    return f"{forecast.sizes['member']} members at " if "member" in forecast.dims else ""


def margins_table(ensemble: HankelEnsemble) -> Table:
    """Margins of the channels, or factors and floors of their scale, and what they rest on."""
    calibration = ensemble.calibration
    assert calibration is not None
    margin, windows, floor = calibration.conformal, calibration.windows, calibration.floor
    what = {
        "constant": "Margin",
        "spread": "Factor k and floor f, ±k·√(σ² + f²),",
        "learnt": "Factor k of a learnt scale and its floor f",
    }[calibration.scale]
    width = margin.margin if floor is None else floor
    title = (
        f"{what} of the {100 * margin.level:g} % band, from "
        f"{counted(sum(windows.values()), 'window')} of {calibration.steps} instants "
        f"({', '.join(windows)})"
    )
    rows = []
    for k, label in enumerate(ensemble.state_labels):
        factor, shown = displayed(label.units)
        cells = (
            *([] if floor is None else [f"{margin.margin[k]:.2f}"]),
            f"{factor * width[k]:.4g}",
            f"{width[k] / ensemble.state_spread[k]:.3f}",
            f"{margin.blocks[k]:.0f}",
            f"{math.floor(1e4 * margin.warranted[k] + 1e-6) / 100:g}",
        )
        rows.append((label.name, shown, *map(Number, cells)))
    names = ("margin",) if floor is None else ("k", "f")
    columns = ("channel", "unit", *names, "in SD", "blocks", "warranted %")
    return Table("margins", title, columns, rows)
