"""Comparison of models with the measurement: forecasts of test runs, and their table.

Runs and forecasts at full scale, by Froude's law.

Parts of runs on which the band of an ensemble is calibrated.

Skill against lead time: a model in service, to which waves to come are not known.
"""

import math
import reprlib
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from seakeep import metrics, statistics
from seakeep.arrays import Datasets, Groups, Progress, undefined, whole_number
from seakeep.campaign import Campaign, load_prepared
from seakeep.check.parts import samples_in, whole_span
from seakeep.conventions import displayed, froude_factor, is_elevation
from seakeep.core.bootstrap import FEWEST_SAMPLES
from seakeep.errors import DataError, RequestError, warn
from seakeep.metrics import root_mean_square
from seakeep.models import Model, is_ensemble
from seakeep.models.calibration import Band
from seakeep.models.forecasts import status_text
from seakeep.models.labelled import channel_matrix, check_channels
from seakeep.models.live import SMALL, Servable, held_samples
from seakeep.models.registry import is_linear
from seakeep.signals import encounter_period
from seakeep.signals.time_axis import instant_text, span_text, usual_step
from seakeep.study.fit import warn_of_repeats, warn_of_waves
from seakeep.study.plan import between, named
from seakeep.toml import parse_length


@dataclass(frozen=True, eq=False)
class Comparison:
    """Forecast and measurement of one run.

    Parameters
    ----------
    run : str
        Name of the run.
    sea_state : str
        As the campaign states it.
    forecast : Dataset
        As :meth:`seakeep.HankelDMDcModel.forecast` gives it; for an ensemble, the members' mean.
    measured : Dataset
        The states at the same instants.
    inputs : Dataset
        The inputs over the forecast, drawn below it.
    band : Dataset, optional
        For an ensemble: ``lower`` and ``upper`` over ``statistic``, at the same instants.
    """

    run: str
    sea_state: str
    forecast: xr.Dataset
    measured: xr.Dataset
    inputs: xr.Dataset
    band: xr.Dataset | None = None

    @property
    def start(self) -> float:
        """Instant of the last measured state, s."""
        return float(self.forecast.attrs["start"])

    @property
    def status(self) -> str:
        """Status: "ok", the instant of divergence, or the number of diverged members."""
        return str(self.forecast.attrs["status"])

    @property
    def complete(self) -> bool:
        """Whether there is a forecast at all instants: members that were lost are left out."""
        return not self.forecast.isnull().to_dataarray().any()

    @property
    def full_scale(self) -> float | None:
        """Scale factor, where times and values are at full scale; None at model scale."""
        attrs = self.forecast.attrs
        return float(attrs["scale_factor"]) if attrs.get("scale") == "full" else None

    @property
    def anrmse(self) -> float:
        """Average of the channels' NRMSE."""
        return float(metrics.anrmse(predicted=self.forecast, measured=self.measured))


def in_degrees(comparison: Comparison) -> Comparison:
    """Turn the angles of a comparison into degrees, for tables and figures that people read.

    Parameters
    ----------
    comparison : Comparison
        In SI units.

    Returns
    -------
    Comparison
        Radians, and their rates, turned into degrees; error measures do not change.
    """
    return _converted(comparison, with_degrees)


def _converted(comparison: Comparison, convert: Callable[[xr.Dataset], xr.Dataset]) -> Comparison:
    parts: dict[str, Any] = {
        part: convert(data)  # a model may have no inputs, and no band
        for part in ("forecast", "measured", "inputs", "band")
        if (data := getattr(comparison, part))
    }
    return replace(comparison, **parts)


def at_full_scale(comparison: Comparison, scale: float) -> Comparison:
    """Convert a comparison to full scale by Froude's law.

    Parameters
    ----------
    comparison : Comparison
        At model scale, in SI units.
    scale : float
        Scale factor, full-scale length over model length.

    Returns
    -------
    Comparison
        Times and values at full scale; error measures do not change.

    Raises
    ------
    RequestError
        If the unit of a channel does not scale.
    """
    return _converted(comparison, lambda run: to_full_scale(run, scale))


def with_degrees(run: xr.Dataset) -> xr.Dataset:
    """Turn the angles of a run or a forecast, and their rates, into degrees.

    Parameters
    ----------
    run : Dataset
        In SI units.

    Returns
    -------
    Dataset
    """
    return _scaled(run, displayed)


def compare(model: Model, campaign: Campaign, *where: Any, **how: Any) -> list[Comparison]:
    """Forecast runs of a campaign with one model and pair the forecasts with the measurement.

    Parameters
    ----------
    model : HankelDMDcModel or HankelEnsemble
        The model. For an ensemble the members' mean is judged, and their band beside it.
    campaign : Campaign
        The campaign.
    *where, **how
        As in :func:`compare_models`: `runs`, `start`, `steps`, and by name `progress`, `members`,
        `level`, `band`, `executor`.

    Returns
    -------
    list of Comparison
        One per run.

    Raises
    ------
    RequestError, DataError
        As :func:`compare_models`.
    """
    return compare_models({"model": model}, campaign, *where, **how)["model"]


def compare_models(
    models: Mapping[str, Model],
    campaign: Campaign,
    runs: Sequence[str] = (),
    start: float | str | None = None,
    steps: int | str | None = None,
    progress: Progress | None = None,
    *,
    members: Progress | None = None,
    level: float = 0.95,
    band: Band = "members",
    executor: Executor | None = None,
) -> dict[str, list[Comparison]]:
    """Forecast the same instants with several models and pair them with the measurement.

    Parameters
    ----------
    models : mapping of str to model
        Models by name; by default all start where the one with the longest history can.
    campaign : Campaign
        The campaign.
    runs : sequence of str, optional
        Runs; by default those that test.
    start : float or str, optional
        Instant of the last measured state, s or encounter periods (``"20 T"``), of a text with a
        plus (``"+300"``) after the start of each run; by default the first possible one of the
        run's test span once the waves have come, its delay history read from before the span
        where the run has it.
    steps : int or str, optional
        Number of instants, or a length (``"15 T"``); by default to the end of the test span, or
        as far as the waves are measured that the models look ahead to.
    progress : callable, optional
        Called as ``progress(done, total, run)`` while runs are prepared.
    members : callable, optional
        Called as ``members(done, total, what)`` while members of an ensemble are at work.
    level : float, optional
        Probability between the bounds of an ensemble's band.
    band : {"members", "calibrated"}, optional
        For an ensemble: quantiles of the members, or these moved outwards as
        :meth:`seakeep.models.HankelEnsemble.calibrate` found.
    executor
        As in :meth:`seakeep.models.HankelEnsemble.forecast`.

    Returns
    -------
    dict of str to list of Comparison
        One per run, by model.

    Raises
    ------
    RequestError
        If a run is unknown or none tests, `start` and `steps` do not fit, or the models forecast
        different states.
    DataError
        If a run cannot be read or used, or the time steps of the models differ.

    Warns
    -----
    SeakeepWarning
        If an input of a test run repeats what the model was trained on.
    """
    prepared, windows = read_tests(models, campaign, runs, start, steps, progress)
    compared: dict[str, list[Comparison]] = {}
    for label, model in models.items():
        warn_of_repeats(model, campaign, prepared)
        compared[label] = []
        for name, run in prepared.items():
            begin, instants = windows[label, name]
            if is_ensemble(model):
                tell = named(members, f"{name}, ")
                forecast = model.forecast_summary(
                    run, begin, instants, level=level, band=band, executor=executor, progress=tell
                )
            else:
                forecast = model.forecast(run, begin, instants)
            each = _judged(model, run, name, forecast)
            compared[label].append(each)
            _warn_of_known(model, each)
            warn_of_waves(model, run, name, each.start, each.measured.sizes["time"])
            if (until := float(forecast.attrs.get("reads_input_until", -1.0))) > 0.0:
                warn(
                    f"the forecast of {name} reads the inputs up to {until:.3g} s after the "
                    "instant that it forecasts: the model needs them ahead of time."
                )
    return compared


def read_tests(
    models: Mapping[str, Model],
    campaign: Campaign,
    runs: Sequence[str],
    start: float | str | None,
    steps: int | str | None,
    progress: Progress | None = None,
) -> tuple[Groups, dict[tuple[str, str], tuple[float, int]]]:
    """Prepared runs; by model and run, the start and the number of instants of its forecast.

    What one of these forecasts would refuse is refused here, before any is made. Arguments and
    errors as :func:`compare_models`.
    """
    wanted = list(runs) or campaign.test_runs
    if not wanted:
        raise RequestError(
            "no run of the campaign tests a model. Name one with --run, or give one "
            "role = 'test' or a span test = [start, end]."
        )
    check_alike(models)
    used = list(dict.fromkeys(c for m in models.values() for c in (*m.states, *m.inputs)))
    prepared = load_prepared(campaign, names=wanted, progress=progress, channels=used)
    history = max(model.history_samples for model in models.values())
    lead = max(model.signature.lead_samples for model in models.values())
    windows = {}
    for (label, model), (name, run) in product(models.items(), prepared.items()):
        check_channels(run, used, name)
        first = None if start is None else instant_of(start, campaign, run, "start")
        count = None if steps is None else samples_of(steps, campaign, run, model.dt, "steps")
        span = whole_span(run, "test")
        at, last = samples_in(run, used, span, model.dt, history, lead, first)
        begin = float(run["time"][at]) if first is None else first
        windows[label, name] = begin, count or max(last - at, 1)
        model.read_windows(run, [begin], windows[label, name][1])
    return prepared, windows


def check_alike(models: Mapping[str, Model]) -> None:
    """Refuse models that forecast different channels."""
    forecast = [model.states for model in models.values()]
    if any(states != forecast[0] for states in forecast):
        listed = "; ".join(f"{name}: {', '.join(each.states)}" for name, each in models.items())
        raise RequestError(
            f"models are compared on the same channels, and these forecast different ones ({listed}"
            "). Compare them one by one, or fit them with the same states."
        )


def _warn_of_known(model: Model, compared: Comparison) -> None:
    """Warn where a forecast lies in what the model, or its calibrated band, was made from."""
    first, last = compared.start, float(compared.measured["time"][-1])
    spans = {f"the forecast of {compared.run} lies in what trained the model": model.training_spans}
    if compared.forecast.attrs.get("band") == "calibrated":
        calibration: Any = getattr(model, "calibration", None)
        spans["the band was calibrated on a part of this forecast"] = calibration.spans
    for words, known in spans.items():
        begin, end = known.get(compared.run, (np.inf, -np.inf))
        if first < end - 0.5 * model.dt and last > begin:
            warn(
                f"{words} ({span_text(begin, end, model.dt)}): this shows memory, not skill. Test "
                "elsewhere (--run, --start, --steps)."
            )


def _judged(model: Model, run: xr.Dataset, name: str, forecast: xr.Dataset) -> Comparison:
    """Pair a forecast with what was measured at its instants."""
    end = run["time"].values[-1]
    # The last instant may lie a step beyond the record: the input before it is known.
    inside = forecast[model.states].sel(time=slice(None, end))
    if (known := inside.sizes["time"]) < FEWEST_SAMPLES:
        raise RequestError(
            f"the forecast of {name} from {forecast.attrs['start']:g} s has {known} measured "
            f"instant(s), and errors are judged over {FEWEST_SAMPLES} or more; the run ends at "
            f"{end:g} s. Choose an earlier start or more steps."
        )
    there = run.sel({"time": inside["time"]})
    for state in model.states:
        if gone := int(there[state].isnull().sum()):
            warn(
                f"{name}: {state} was not measured at {gone} of {known} instants of the forecast, "
                "and is not judged. Fill the gap in [preparation], or choose another start or "
                "fewer steps."
            )
    has_band = "statistic" in inside.dims
    return Comparison(
        run=name,
        sea_state=str(run.attrs.get("sea_state", "")),
        forecast=inside.sel(statistic="mean", drop=True) if has_band else inside,
        measured=there[model.states],
        inputs=there[model.inputs],
        band=inside.sel(statistic=["lower", "upper"]) if has_band else None,
    )


def comparison_table(comparisons: Sequence[Comparison], *, intervals: bool = True) -> xr.Dataset:
    """Judge forecasts channel by channel.

    Parameters
    ----------
    comparisons : sequence of Comparison
        From :func:`compare`.
    intervals : bool, optional
        Whether to compute the bounds below, which takes most of the time.

    Returns
    -------
    Dataset
        Over ``run`` and ``channel``: ``nrmse``, ``training_nrmse`` (the same error in standard
        deviations of the training), ``fit`` (%), ``nammae``, ``sd_ratio`` (predicted
        over measured), ``measured_min``, ``measured_max``, ``predicted_min``, ``predicted_max``
        (in ``channel_units``); over ``run``: ``anrmse`` and ``mean_nammae`` over the channels that
        can be judged; of these four also ``…_lower`` and ``…_upper``, the bounds of a 95 % interval
        (:mod:`seakeep.metrics`); ``training_anrmse`` over all, ``slack_channels`` (how many
        cannot), ``status``, ``start``, and ``conditional_on``: the measured output that the
        forecast read after its start, or an empty text; ``probe_offset`` and
        ``probe_offset_spread`` (m), NaN where the run has none; ``look_ahead``, how long after an
        instant the last wave lies that its forecast reads (s). For an ensemble also ``coverage``,
        the percentage of measured instants that lie in the band, ``band_width``, its mean width (in
        ``channel_units``), and ``relative_band_width`` (in measured standard deviations); over
        ``run``: ``mean_coverage`` over the channels that can be judged, ``members``, ``diverged``,
        ``level`` and ``band`` ("members" or "calibrated"). At full scale ``scale`` ("full") and
        ``scale_factor`` over ``run``.
    """
    table = xr.concat([_row(comparison, intervals) for comparison in comparisons], dim="run")
    for name, unit in UNITS.items():
        if name in table:
            table[name].attrs["units"] = unit
    return table


def difference_table(compared: Mapping[str, Sequence[Comparison]]) -> xr.Dataset:
    """Compare the errors of several models, run by run and over all runs.

    Parameters
    ----------
    compared : mapping of str to sequence of Comparison
        From :func:`compare_models`.

    Returns
    -------
    Dataset
        As :func:`seakeep.metrics.anrmse_differences` gives it, with the names of models and runs,
        and ``wave_period`` over ``run``: the mean zero-up-crossing period of the first wave input
        over the forecast, s; NaN without one; at full scale also ``scale_factor``.
    """
    first = next(iter(compared.values()))
    out = metrics.anrmse_differences(
        [[each.forecast for each in of] for of in compared.values()],
        [each.measured for each in first],
        INTERVAL,
    )
    runs = [each.run for each in first]
    periods = [wave_period(each.inputs) for each in first]
    if first[0].full_scale is not None:
        out["scale_factor"] = "run", [each.full_scale for each in first]
    return out.assign(wave_period=("run", periods, {"units": "s"})).assign_coords(
        model=list(compared), run=runs
    )


def wave_period(inputs: xr.Dataset, otherwise: xr.DataArray | None = None) -> float:
    """Mean period of the first wave elevation among inputs, or of another series, s; else NaN."""
    waves = (each for name, each in inputs.data_vars.items() if is_elevation(str(name)))
    series = next(waves, otherwise)
    if series is None or series.size < 3:
        return np.nan
    try:
        return encounter_period(series.values, usual_step(series["time"].values))
    except DataError:
        return np.nan


INTERVAL = 0.95
"""Probability between the bounds of the measures."""
WITH_BOUNDS = {
    "nrmse": metrics.nrmse,
    "nammae": metrics.normalised_extremes_error,
    "anrmse": metrics.anrmse,
    "mean_nammae": metrics.nammae,
}
UNITS = {"fit": "%", "coverage": "%", "look_ahead": "s"}
"""Of columns of the table that are neither pure numbers nor in the unit of the channel."""


def _row(comparison: Comparison, intervals: bool) -> xr.Dataset:
    forecast, facts = comparison.forecast, comparison.forecast.attrs
    names = [str(name) for name in forecast.data_vars]
    # Over (channel, time): a sum then runs along the samples of a channel.
    p, m = (each[names].to_dataarray("channel") for each in (forecast, comparison.measured))
    pair: dict[str, Any] = {
        "predicted": p.values.T.copy(),
        "measured": m.values.T.copy(),
        "training_std": [forecast[n].attrs.get("training_std", np.nan) for n in names],
        "noise_std": [comparison.measured[n].attrs.get("noise_std", 0.0) for n in names],
    }
    slack = metrics.is_slack(**pair)
    in_training_sd = root_mean_square(pair["predicted"] - pair["measured"]) / pair["training_std"]
    with undefined():
        ratio = p.std("time", ddof=1, skipna=False) / m.std("time", ddof=1).where(~slack)
    row: dict[str, Any] = {
        "training_nrmse": in_training_sd,
        "training_anrmse": in_training_sd.mean(),
        "fit": metrics.fit_percent(**pair),
        "sd_ratio": ratio.values,
        "measured_min": m.min("time").values,
        "measured_max": m.max("time").values,
        "predicted_min": p.min("time", skipna=False).values,
        "predicted_max": p.max("time", skipna=False).values,
        "slack_channels": int(slack.sum()),
        "status": comparison.status,
        "conditional_on": str(facts.get("conditional_on", "")),
        "probe_offset": float(facts.get("probe_offset", np.nan)),
        "probe_offset_spread": float(facts.get("probe_offset_spread", np.nan)),
        "look_ahead": max(float(facts.get("reads_input_until", 0.0)), 0.0),
        "start": comparison.start,
    }
    for key, measure in WITH_BOUNDS.items():
        row[key] = measure(**pair)
        if intervals:
            row[f"{key}_lower"], row[f"{key}_upper"] = measure(**pair, interval=INTERVAL)
    if comparison.band is not None:
        lower, upper = (comparison.band.sel(statistic=key, drop=True) for key in metrics.BOUNDS)
        coverage = statistics.coverage(lower, upper, comparison.measured)
        # A band without end holds everything: nothing is said of it.
        inside = 100.0 * coverage["inside"].where(np.isfinite(coverage["width"])).values
        row["coverage"], judged = inside, inside[~slack & np.isfinite(inside)]
        row["band_width"] = coverage["width"].values
        row["relative_band_width"] = coverage["relative_width"].values
        row |= {key: facts[key] for key in ("members", "diverged", "level")}
        row["mean_coverage"] = judged.mean() if judged.size else np.nan
        row["band"] = str(facts.get("band", "members"))
    if comparison.full_scale is not None:
        row |= {"scale": "full", "scale_factor": comparison.full_scale}
    units = [str(forecast[name].attrs.get("units", "")) for name in names]
    return xr.Dataset(
        {key: ("channel", each) if np.ndim(each) else each for key, each in row.items()},
        {"run": comparison.run, "channel": names, "channel_units": ("channel", units)},
    )


def instant_of(stated: float | str, campaign: Campaign, run: xr.Dataset, name: str) -> float:
    """Instant in seconds; a text with a plus, such as "+20", counts from the start of the run."""
    origin = float(run["time"][0]) if str(stated).startswith("+") else 0.0
    try:
        return origin + float(stated)
    except (ValueError, OverflowError):
        return origin + _seconds(str(stated), campaign, run, name, "seconds such as 20")


def samples_of(
    stated: float | str, campaign: Campaign, run: xr.Dataset, dt: float, name: str
) -> int:
    """Number of samples; a length in encounter periods is rounded to the nearest one."""
    try:
        count = int(stated) if isinstance(stated, str) else stated
    except ValueError:
        return round(_seconds(str(stated), campaign, run, name, "a whole number such as 400") / dt)
    return whole_number(count, name)


def _seconds(stated: str, campaign: Campaign, run: xr.Dataset, name: str, otherwise: str) -> float:
    """A length in encounter periods, those that the run was prepared with."""
    try:
        length = parse_length(stated)
    except RequestError:
        length = None
    if length is None or length.unit != "T" or not abs(length.value) < 1e9:
        comma = " Write a decimal point, no comma." if "," in stated else ""
        raise RequestError(
            f"{name}: received {reprlib.repr(stated)}. Give {otherwise}, or encounter periods such "
            f"as '15 T'.{comma}"
        )
    return length.value * (run.attrs.get("encounter_period") or campaign.encounter_period())


ATTRIBUTES = {
    "s": {"dt", "start", "encounter_period", "train_span", "test_span", "reads_input_until",
          "input_predicted_from", "diverged_at", "lead_time", "predictable", "period"},
    "m": {"water_depth", "probe_offset", "probe_offset_spread", "x_position", "mean_surge",
          "trained_surge"},
    "m/s": {"celerity", "alignment_celerity"},
}  # fmt: skip
"""Attributes of a run, of a forecast or of their channels, by their unit."""
UNSCALED = {"height", "trained_height", "mean", "trained_low", "trained_high"}
"""Attributes with a number per input, whose units a forecast does not state."""


def to_full_scale(run: xr.Dataset, scale: float, density_ratio: float = 1.0) -> xr.Dataset:
    """Convert a run, or a forecast and its status, from model to full scale.

    Parameters
    ----------
    run : Dataset
        With a coordinate ``time`` in seconds and ``units`` on each variable.
    scale : float
        Scale factor, full-scale length over model length.
    density_ratio : float, optional
        As in :func:`seakeep.signals.froude_factor`.

    Returns
    -------
    Dataset
        Times and values at full scale; units keep their names. ``attrs["scale"]`` says
        ``"full"``; times, lengths and speeds among the attributes are converted with them, and
        numbers per input of a live forecast left out.

    Raises
    ------
    RequestError
        If the run is at full scale already, or a unit does not scale.

    Examples
    --------
    >>> run = xr.Dataset(
    ...     {"heave": ("time", [0.1, 0.2], {"units": "m"})},
    ...     {"time": ("time", [0.0, 1.0], {"units": "s"})},
    ... )
    >>> full = to_full_scale(run, 100.0)
    >>> full["heave"].values, full["time"].values
    (array([10., 20.]), array([ 0., 10.]))
    """
    if run.attrs.get("scale") == "full":
        raise RequestError("the run is at full scale already; convert it once.")

    def factor_of(unit: str) -> tuple[float, str]:
        return froude_factor(unit, scale, density_ratio), unit

    out = _scaled(run, factor_of)
    for name in {"time", "diverged_at"} & set(run.coords):
        out[name] = (factor_of("s")[0] * run[name]).assign_attrs(run[name].attrs)
    out.attrs = {key: each for key, each in run.attrs.items() if key not in UNSCALED}
    out.attrs |= {"scale": "full", "scale_factor": float(scale)}
    for unit, keys in ATTRIBUTES.items():
        by, _ = factor_of(unit)
        for attrs in (out.attrs, *(each.attrs for each in out.data_vars.values())):
            attrs |= {key: _times(by, attrs[key]) for key in keys & attrs.keys()}
    if "outside_training" in run.attrs:
        out.attrs["outside_training"] = f"at model scale: {run.attrs['outside_training']}"
    if "status" in run.attrs:
        _say_status_anew(out)
    return out


def _say_status_anew(forecast: xr.Dataset) -> None:
    """State the instants of a status, and of that of each member, as they are now."""
    attrs, dt = forecast.attrs, float(np.diff(forecast["time"].values[:2]).sum())
    attrs["status"] = status_text(attrs, dt)
    if "status" in forecast:
        shared = {key: attrs[key] for key in attrs.keys() & {"input_predicted_from"}}
        words = [
            status_text(shared if np.isnan(at) else shared | {"diverged_at": at}, dt)
            for at in forecast["diverged_at"].values
        ]
        forecast["status"] = forecast["status"].copy(data=words)


def _times(factor: float, value: Any) -> Any:
    """A number, or a pair of them, times a factor."""
    array = factor * np.asarray(value, dtype=float)
    return tuple(array.tolist()) if array.ndim else float(array)


def _scaled(run: xr.Dataset, factor_of: Callable[[str], tuple[float, str]]) -> xr.Dataset:
    """Multiply channels, and the uncertainties among their attributes, by their factors."""
    out = run.copy()
    for name, channel in run.data_vars.items():
        factor, shown = factor_of(str(channel.attrs.get("units", "")))
        if factor == 1.0 or channel.dtype.kind not in "fiu":
            continue
        known = {"training_std", "noise_std", "accuracy"} & set(channel.attrs)
        spreads = {key: factor * float(channel.attrs[key]) for key in known}
        out[name] = (channel * factor).assign_attrs(channel.attrs | spreads, units=shown)
    return out


def calibration_parts(
    campaign: Campaign, runs: Datasets, dt: float, start: str | None, stop: str | None
) -> Groups:
    """Part of each run between two instants, by default its training span, or the whole run.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    runs : mapping of str to Dataset
        Prepared runs.
    dt : float
        Their time step, s.
    start, stop : str, optional
        Seconds, or encounter periods such as ``"20 T"``; with a plus, such as ``"+300"``, after
        the start of each run; a stop of ``"inf"`` is the end of all.

    Returns
    -------
    dict of str to Dataset
        The parts.

    Raises
    ------
    RequestError
        If an instant lies in none of the runs, or the start at or after the stop.
    """
    spans = {name: (float(each["time"][0]), float(each["time"][-1])) for name, each in runs.items()}
    edges = {}
    for option, stated in (("--start", start), ("--stop", stop)):
        if stated is None:
            continue
        own = {name: instant_of(stated, campaign, run, option) for name, run in runs.items()}
        edges[option], instant = own, next(iter(own.values()), math.nan)
        inside = any(begin <= own[name] <= end for name, (begin, end) in spans.items())
        if not (inside or (option == "--stop" and instant == math.inf)):
            known = ", ".join(f"{name}: {span_text(*span, dt)}" for name, span in spans.items())
            raise RequestError(
                f"{option} {stated} ({instant_text(instant, dt)} s) lies in none of the runs "
                f"({known}). Name an instant inside, or leave {option} out."
            )
    parts = {}
    for name, run in runs.items():
        first, last = run.attrs.get("train_span", spans[name])
        own = {option: instants[name] for option, instants in edges.items()}
        begin, end = own.get("--start", first), own.get("--stop", last)
        if len(edges) == 2 and begin >= end:
            at, until = instant_text(begin, dt), instant_text(end, dt)
            raise RequestError(
                f"--start {start} ({at} s) lies at or after --stop {stop} ({until} s)."
            )
        parts[name] = between(run, (begin, end))
    return parts


STARTS = 24
"""Forecasts of a run: enough for a root mean square known to a seventh."""
PERIODS = 5
"""Longest lead where none is stated, in encounter periods."""


def nowcasts(
    models: Mapping[str, Model],
    campaign: Campaign,
    runs: Sequence[str] = (),
    steps: int | str | None = None,
    *,
    level: float = 0.95,
    progress: Progress | None = None,
) -> Groups:
    """Play runs of a campaign to models in service, and judge what they forecast.

    Parameters
    ----------
    models : mapping of str to Model
        Models by name; an ensemble is held.
    campaign : Campaign
        The campaign.
    runs : sequence of str, optional
        Runs; by default those that test.
    steps : int or str, optional
        Longest lead, samples or a length; by default five encounter periods.
    level : float, optional
        Probability of the band.
    progress : callable, optional
        Called as ``progress(done, total, what)`` after each run and model.

    Returns
    -------
    dict of str to Dataset
        :func:`nowcast` of each model, over ``run``.

    Raises
    ------
    RequestError
        If a model cannot serve, or a run is too short.
    """
    every = {}
    for name, model in models.items():
        if (follows := served(model)) is None:
            raise RequestError(
                f"{name} is a {model.kind} model, which cannot be put into service: it has no "
                "delayed states to estimate. Name a Hankel or ARX model."
            )
        every[name] = follows
    channels = {c for m in models.values() for c in (*m.states, *m.inputs)}
    prepared = load_prepared(campaign, names=list(runs) or campaign.test_runs, channels=channels)
    longest = steps or f"{PERIODS} T"
    out: dict[str, list[xr.Dataset]] = {name: [] for name in models}
    for done, (name, key) in enumerate(product(every, prepared), 1):
        dt = every[name].signature.dt
        count = samples_of(longest, campaign, prepared[key], dt, "steps")
        out[name].append(nowcast(every[name], prepared[key], count, level=level))
        if progress is not None:
            progress(done, len(every) * len(prepared), f"{name}, {key}")
    return {name: xr.concat(each, xr.Variable("run", list(prepared))) for name, each in out.items()}


def nowcast(model: Servable, run: xr.Dataset, steps: int, *, level: float = 0.95) -> xr.Dataset:
    """Play a run to a model in service, sample by sample, and judge its forecasts.

    Parameters
    ----------
    model : HankelDMDcModel or HankelEnsemble
        What has ``live``.
    run : Dataset
        A prepared run; in its test span, if it states one, forecasts start at even distances.
    steps : int
        Longest lead, samples.
    level : float
        As in :func:`nowcasts`.

    Returns
    -------
    Dataset
        Over (channel, lead): ``error`` and ``claimed``, root mean square error and what the model
        says of it, in training SDs, and ``coverage`` of the band, %; over channel ``lead_time``,
        s, up to which ``error`` stays below ``attrs["share"]``: the longest lead where it never
        rises above. No wave after a start is read.

    Raises
    ------
    RequestError
        If no forecast of so many steps fits into the run.
    """
    whole_number(steps, "steps")
    signature = model.signature
    time, name = run["time"].values, str(run.attrs.get("run", "the run"))
    begin, end = whole_span(run, "test")
    first = max(int(np.searchsorted(time, begin)), signature.history_samples - 1)
    last = int(np.searchsorted(time, end + 0.5 * signature.dt)) - 1 - steps
    if last < first:
        raise RequestError(
            f"{name} has {time.size} samples, and a forecast of {steps} steps takes "
            f"{signature.history_samples} of history before. Give fewer steps, or another run."
        )
    starts = np.unique(np.linspace(first, last, min(STARTS, last - first + 1)).astype(int))
    u = channel_matrix(run, signature.inputs, name)
    y = channel_matrix(run, signature.states, name)
    spread = signature.state_scale.spread
    live = model.live(like=run)
    forecasts = []
    for at in range(last + 1):
        live.step(u[at], y[at])
        if at in starts:
            forecast = live.forecast(steps, level=level)
            forecasts.append([forecast[each].values for each in signature.states])
    # Each over (start, lead, channel).
    mean, std, lower, upper = np.transpose(forecasts, (2, 0, 3, 1))
    truth = np.stack([y[at + 1 : at + steps + 1] for at in starts])
    known = np.isfinite(truth)
    judged = np.where(known.any(axis=0), known.sum(axis=0), np.nan)
    error, claimed = (
        np.sqrt(np.where(known, (each / spread) ** 2, 0.0).sum(axis=0) / judged)
        for each in (mean - truth, std)
    )
    inside = ((lower <= truth) & (truth <= upper)).sum(axis=0)
    over, sd = ("lead", "channel"), {"units": "training SD"}
    leads = signature.dt * np.arange(1, steps + 1)
    return xr.Dataset(
        {
            "error": (over, error, sd),
            "claimed": (over, claimed, sd),
            "coverage": (over, 100.0 * inside / judged, {"units": "%"}),
            "lead_time": ("channel", signature.dt * held_samples(error <= SMALL), {"units": "s"}),
        },
        coords={
            "lead": ("lead", leads, {"units": "s", "long_name": "lead time"}),
            "channel": list(signature.states),
        },
        attrs={"share": SMALL, "level": level, "starts": len(starts)},
    )


def served(model: Model) -> Servable | None:
    """What follows a run sample by sample: the model, or its members held; None without states."""
    if is_ensemble(model):
        return model.hold()
    return model if is_linear(model) else None
