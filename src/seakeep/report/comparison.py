"""Comparisons and forecasts as tables: blocks for the terminal, CSV with all digits."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.files import MARK, replacing, write_netcdf
from seakeep.report.tables import MISSING, Table, change, interval, number, plain_cell
from seakeep.report.tables import text as text_of
from seakeep.study.judge import verdict

__all__ = [
    "band_findings",
    "comparison_blocks",
    "difference_blocks",
    "forecast_header",
    "forecast_words",
    "look_ahead_words",
    "model_blocks",
    "plain_cells",
    "write_comparison",
    "write_differences",
    "write_forecast",
]

_SHOWN = {
    "nrmse": ("NRMSE", 3, "anrmse"),
    "training_nrmse": ("in training SD", 3, "training_anrmse"),
    "fit": ("fit %", 1, ""),
    "nammae": ("NAMMAE", 3, "mean_nammae"),
    "sd_ratio": ("SD ratio", 3, ""),
    "coverage": ("in band %", 1, "mean_coverage"),
    "relative_band_width": ("width in SD", 3, ""),
}
"""Columns of a terminal: heading, decimals, and the average over the channels."""
_IN_UNITS = {
    "measured_min": "min measured",
    "predicted_min": "min predicted",
    "measured_max": "max measured",
    "predicted_max": "max predicted",
    "band_width": "mean width of band",
}
"""Columns of a second table, in the unit of the channel."""
_STORED = (
    *("nrmse", "nrmse_lower", "nrmse_upper", "training_nrmse", "fit"),
    *("nammae", "nammae_lower", "nammae_upper", "sd_ratio", "measured_min", "predicted_min"),
    *("measured_max", "predicted_max", "coverage", "band_width", "relative_band_width"),
)
"""Columns of a CSV file."""
_OF_RUNS = (
    *("start", "status", "anrmse", "anrmse_lower", "anrmse_upper", "training_anrmse"),
    *("conditional_on", "look_ahead", "probe_offset", "probe_offset_spread"),
)
UNTIL = "waves read until [s]"
"""Column of a forecast's CSV file where the model looks ahead."""
_OF_BANDS = ("band", "level", "members", "diverged")
_OF_SCALE = ("scale", "scale_factor")


def comparison_blocks(table: xr.Dataset) -> Iterator[Table]:
    """Comparison of forecasts with measurements, tables per run that fit a terminal."""
    shown = {name: each for name, each in _SHOWN.items() if name in table}
    for run in table["run"].values:
        at = table.sel(run=run)
        means = [number(at[mean], digits) if mean else "" for _, digits, mean in shown.values()]
        yield _by_channel(
            at,
            "comparison",
            _title(at),
            [heading for heading, _, _ in shown.values()],
            lambda one: [number(one[key], digits) for key, (_, digits, _) in shown.items()],
            means,
            _note(at),
        )
        yield _by_channel(
            at,
            "intervals",
            "intervals over blocks of the forecast",
            ("NRMSE, 95 %", "NAMMAE, 95 %"),
            lambda one: [interval(one, "nrmse"), interval(one, "nammae")],
            [interval(at, "anrmse"), interval(at, "mean_nammae")],
        )
        yield _extremes(at, "extremes")


def _by_channel(
    at: xr.Dataset,
    name: str,
    title: str,
    heads: Sequence[str],
    cells: Callable[[xr.Dataset], Sequence[str]],
    averages: Sequence[str] = (),
    note: str = "",
    text_columns: int = 0,
) -> Table:
    """A row per channel of a run, with the averages over the channels last."""
    run = at["run"].values
    rows = [(str(each), *cells(at.sel(channel=each))) for each in at["channel"].values]
    last = [len(rows)] if averages else []
    if averages:
        rows.append(("average", *averages))
    numeric = range(1 + text_columns, 1 + len(heads))
    columns = ("channel", *heads)
    return Table(f"{name}_{run}", f"{run}: {title}", columns, rows, note, numeric, averages=last)


def _extremes(at: xr.Dataset, title: str) -> Table:
    shown = {name: heading for name, heading in _IN_UNITS.items() if name in at}
    return _by_channel(
        at,
        "extremes",
        title,
        ("unit", *shown.values()),
        lambda one: [
            str(one["channel_units"].values),
            *(text_of(one[key], digits=None) for key in shown),
        ],
        text_columns=1,
    )


def _title(at: xr.Dataset) -> str:
    said = ["forecast against measurement"]
    if "scale" in at:
        said.append(f"full scale (1:{float(at['scale_factor']):g})")
    if "level" in at:
        level, kind = 100.0 * float(at["level"]), _kind(str(at["band"].values))
        said.append(f"{level:g} % {kind}band")
    return ", ".join(said)


def _note(at: xr.Dataset) -> str:
    said = []
    if (slack := int(at["slack_channels"])) > 0:
        said.append(f"{slack} still channel{'s' * (slack > 1)} left out of the average")
    if (status := str(at["status"].values)) != "ok":
        said.append(status)
    if condition := str(at["conditional_on"].values):
        said.append(f"conditional on measured {condition}")
    if ahead := look_ahead_words(float(at["look_ahead"])):
        said.append(ahead)
    offset, spread = float(at["probe_offset"]), float(at["probe_offset_spread"])
    if np.isfinite(offset):
        known = f" ± {spread:.2g}" if np.isfinite(spread) else ""
        said.append(f"probe offset {offset:.3g}{known} m")
    return "; ".join(said)


def model_blocks(
    tables: Mapping[str, xr.Dataset], references: Mapping[str, Sequence[str]]
) -> Iterator[Table]:
    """Several models beside each other, a table of averages and one of channels per run."""
    first = next(iter(tables.values()))
    heads = ("model", "ANRMSE", "95 %", "in training SD", "NAMMAE")
    for run in first["run"].values:
        of_run = {name: table.sel(run=run) for name, table in tables.items()}
        rows, told, ahead = [], [], []
        for name, at in of_run.items():
            others = (number(at[key]) for key in ("training_anrmse", "mean_nammae"))
            rows.append((name, number(at["anrmse"]), interval(at, "anrmse"), *others))
            if (status := str(at["status"].values)) != "ok":
                told.append(f"{name}: {status}")
            if words := look_ahead_words(float(at["look_ahead"])):
                ahead.append(f"{name} {words}")
        title, note = f"{run}: models against measurement", "; ".join(told + ahead)
        yield Table(f"models_{run}", title, heads, rows, note, range(1, len(heads)))
        if skill := _skill(of_run, references, str(run)):
            yield skill
        name, at = next(iter(of_run.items()))
        errors = (("model", "channel"), [each["nrmse"].values for each in of_run.values()])
        yield _by_channel(
            at.assign(every=errors),
            "channels",
            "NRMSE",
            [*of_run],
            lambda one: [*map(number, one["every"])],
        )
        yield _extremes(at, f"extremes of {name}")


def _skill(
    of_run: Mapping[str, xr.Dataset], references: Mapping[str, Sequence[str]], run: str
) -> Table | None:
    """Change of the ANRMSE to each model from the best of some references, which have no row."""
    errors = {name: float(at["anrmse"]) for name, at in of_run.items()}
    best = [min((errors[each] for each in names), default=np.nan) for names in references.values()]
    known = {each for names in references.values() for each in names}
    rows = [
        (name, *(change(error / each) for each in best))
        for name, error in errors.items()
        if name not in known
    ]
    if not (rows and references):
        return None
    heads = ("model", *(f"from {each}" for each in references))
    title = f"{run}: change of ANRMSE from the baselines'"
    return Table(f"skill_{run}", title, heads, rows, "", range(1, len(heads)))


def difference_blocks(table: xr.Dataset) -> Iterator[Table]:
    """Errors of several models run by run, and over all runs their change from the first one."""
    models, runs = ([str(each) for each in table[key].values] for key in ("model", "run"))
    if len(runs) > 1:
        rows = [
            (
                runs[k],
                f"{period:.3g}" if np.isfinite(period) else MISSING,
                *map(number, table["anrmse"].values[:, k]),
            )
            for k in np.argsort(table["wave_period"].values, kind="stable")
            for period in [table["wave_period"].values[k]]
        ]
        rows.append(("mean", "", *map(number, table["all_anrmse"].values)))
        heads, last = ("run", "waves, s", *models), [len(runs)]
        title, numeric = f"{len(runs)} runs by wave period: ANRMSE", range(1, len(heads))
        yield Table("by_run", title, heads, rows, "", numeric, averages=last)
    changes = []
    for k, name in enumerate(models):
        value, low, high = (float(table[f"all_{key}"][k]) for key in ("change", "lower", "upper"))
        known = k > 0 and bool(np.isfinite([low, high]).all())
        changes.append(
            (
                name,
                number(table["all_anrmse"][k]),
                change(1 + value) if k else "",
                *((change(1 + low, 1 + high), verdict(low, high)) if known else ("", "")),
            )
        )
    of = f"{len(runs)} runs" if len(runs) > 1 else runs[0]
    title = f"{of}: change of ANRMSE from {models[0]}"
    note = "Paired intervals over redrawn blocks of the forecast; they hold for these runs."
    heads = ("model", "ANRMSE", "change", "95 %", "verdict")
    yield Table("differences", title, heads, changes, note, (1, 2, 3))


def write_differences(table: xr.Dataset, path: Path) -> Path:
    """Write errors of several models as CSV, a row per run and model, and per model for all."""
    keys = ("anrmse", "anrmse_lower", "anrmse_upper", "change", "lower", "upper", "wave_period")
    each = table[[*keys]].to_dataframe()
    every = table[[name for name in table.data_vars if str(name).startswith("all_")]]
    of_all = every.to_dataframe().rename(columns=lambda name: name.removeprefix("all_"))
    whole = pd.concat([each.reset_index(), of_all.reset_index().assign(run="")])
    return _write(whole, ["run", "wave_period", "model"], path)


def _write(table: pd.DataFrame, front: Sequence[str], path: Path) -> Path:
    """Write a table as CSV, some of its columns first."""
    table = table[[*front, *(name for name in table.columns if name not in front)]]
    with replacing(path) as temporary:
        plain_cells(table).to_csv(temporary, index=False)
    return path


def band_findings(table: xr.Dataset) -> list[str]:
    """Sentences on the bands of an ensemble, one per run; none for a single model."""
    if "coverage" not in table:
        return []
    said = []
    for run in table["run"].values:
        rows = table.sel(run=run)
        level, found = 100.0 * float(rows["level"]), float(rows["mean_coverage"])
        lost, members = int(rows["diverged"]), int(rows["members"])
        left_out = f"; {lost} of {members} members diverged and are left out" if lost else ""
        if not np.isfinite(found):
            said.append(f"{run}: there is no band to judge{left_out}.")
            continue
        words = "as it claims" if abs(found - level) <= 5.0 else "not what it claims"
        if found < level - 20.0:
            words = "far too little"
        kind = str(rows["band"].values)
        said.append(
            f"{run}: the {level:g} % {_kind(kind)}band of {members - lost} members holds "
            f"{found:.0f} % of the measured instants, {words}. {_CARRIES[kind]}{left_out}."
        )
    return said


def _kind(band: str) -> str:
    """Word before a band that is not that of the members."""
    return "calibrated " if band == "calibrated" else ""


_CARRIES = {
    "members": "It carries the spread of the members, and no noise or model error",
    "calibrated": "It carries the errors of the sea and the horizon that it was calibrated on",
}


def write_comparison(tables: Mapping[str, xr.Dataset], path: Path) -> Path:
    """Write comparison tables as CSV, a row per run and channel, full precision."""
    frames = []
    for model, table in tables.items():
        frame = table[[name for name in _STORED if name in table]].to_dataframe().reset_index()
        for name in (*_OF_RUNS, *(each for each in (*_OF_BANDS, *_OF_SCALE) if each in table)):
            frame[name] = frame["run"].map(table[name].to_series())
        frames.append(frame.assign(model=model) if len(tables) > 1 else frame)
    whole = pd.concat(frames, ignore_index=True)
    front = ["run", "channel", "channel_units", *["model"] * (len(tables) > 1)]
    return _write(whole, front, path)


def plain_cells(table: pd.DataFrame) -> pd.DataFrame:
    """A table in which no text is a formula."""
    return table.map(lambda cell: plain_cell(cell) if isinstance(cell, str) else cell)


def forecast_header(states: Sequence[str]) -> str:
    """Pattern of the start of a CSV file that :func:`write_forecast` writes.

    Measurements have such headers too: ours alone end in CR LF, and their rows in LF.
    """
    one = rf"'?({'|'.join(map(re.escape, states))})( (std|lower|upper|member \d+))? \[[^]]*\]"
    return rf'time \[s\](,"?{one}"?)+(,{re.escape(UNTIL)})?(,scale_factor)?\r\n[^\r\n]*\n'


def look_ahead_words(seconds: float) -> str:
    """How far a forecast reads the waves, as a clause; empty without a look-ahead."""
    return f"reads the waves up to {seconds:.3g} s after each instant" if seconds > 0.0 else ""


def write_forecast(forecast: xr.Dataset, path: Path) -> Path:
    """Write a forecast as NetCDF, or as CSV with a column per channel, full precision."""
    with replacing(path) as temporary:
        if path.suffix == ".nc":
            write_netcdf(temporary, forecast.assign_attrs({MARK: "forecast"}))
        else:
            # Instants are multiples of a step; nine decimals hide the rounding of the product.
            time = pd.Index(forecast["time"].values.round(9), name="time [s]")
            text = pd.DataFrame(_columns(forecast), index=time).to_csv(lineterminator="\n")
            header, rows = text.split("\n", 1)
            temporary.write_text(f"{header}\r\n{rows}", encoding="utf-8", newline="")
    return path


def _columns(forecast: xr.Dataset) -> dict[str, FloatArray]:
    columns = {}
    for name, variable in forecast.data_vars.items():
        if "time" not in variable.dims:
            continue
        units = variable.attrs.get("units", "")
        for dim, words in (("statistic", "{}"), ("member", "member {}")):
            if dim in variable.dims:
                for each in variable[dim].values:
                    what = "" if each == "mean" else f" {words.format(each)}"
                    columns[plain_cell(f"{name}{what} [{units}]")] = variable.sel(
                        {dim: each}
                    ).values
                break
        else:
            columns[plain_cell(f"{name} [{units}]")] = variable.values
    if (ahead := float(forecast.attrs.get("reads_input_until", 0.0))) > 0.0:
        columns[UNTIL] = (forecast["time"].values + ahead).round(9)
    if forecast.attrs.get("scale") == "full":
        scale = float(forecast.attrs["scale_factor"])
        columns["scale_factor"] = np.full(forecast.sizes["time"], scale)
    return columns


def forecast_words(forecast: xr.Dataset) -> str:
    """What a forecast of an ensemble holds, for a message; empty for a single model's."""
    if "statistic" in forecast.dims:
        level = 100.0 * float(forecast.attrs["level"])
        kept = int(forecast.attrs["members"]) - int(forecast.attrs["diverged"])
        kind = _kind(str(forecast.attrs.get("band", "members")))
        return f"mean, std and {level:g} % {kind}band of {kept} members at "
    return f"{forecast.sizes['member']} members at " if "member" in forecast.dims else ""
