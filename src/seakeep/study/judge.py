"""Statistics of a study: boxes, divergences, coverage and trend, as the paper and as recommended.

The paper joins the test windows of a model's (mean) forecast and of the measurement, bootstraps
the joined series in blocks that may cross a join, and takes the bandwidth and the block length as
printed. The recommended variant lets no block cross a join, and takes Silverman's bandwidth and
the block length of Politis and White.
"""

from __future__ import annotations

import warnings
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep import statistics
from seakeep.arrays import FloatArray
from seakeep.core.calibration import band_scale, calibrated_bounds
from seakeep.core.coverage import CoverageTable
from seakeep.errors import DataError, RequestError, SeakeepWarning, warn
from seakeep.models import KINDS
from seakeep.models.executor import in_order
from seakeep.study.plan import random_stream
from seakeep.study.settings import StudySettings

BANDS = ("all", "low", "wave")
"""ε(t) as a whole, and in its two bands."""
MEASURES = ("nrmse", "nammae", "training_nrmse")
"""Errors of a cell: both of the paper, in SD of the window, and the first in SD of the training."""

VARIANTS: dict[str, dict[str, Any]] = {
    "paper": {"block_length": "carlstein", "bandwidth": "paper", "joins": True},
    "recommended": {"block_length": "politis_white", "bandwidth": "silverman", "joins": False},
}
CONSTANT = ("hold_last", "mean")
"""Kinds of references that read nothing after the start."""
SHOWN = 5
"""Lost forecasts that a warning names."""
TREND_SERIES = 500
DIFFERENCES = 500
"""Redrawn tables of cells for the interval of a difference between models."""


def judge(
    groups: Mapping[str, xr.Dataset],
    settings: StudySettings,
    channels: Sequence[str],
    executor: Executor | None = None,
) -> dict[str, xr.Dataset]:
    """All statistics of a study, as groups ``statistics/…``; the densities side by side."""
    kinds = {name: each.kind for name, each in settings.models.items()}
    seed, level = settings.study.seed, settings.statistics.level
    found: dict[str, dict[str, xr.Dataset | None]] = defaultdict(dict)
    for name in settings.tests:
        test = groups[f"tests/{name}"]
        found["boxes"][name] = boxes = box_table(test)
        rng = random_stream(seed, f"differences.{name}")
        found["differences"][name] = changes = difference_table(test, groups["training"], rng)
        found["skill"][name] = skill_table(boxes, changes, kinds)
        if test.sizes["ensemble"]:
            calibration = groups.get("calibration")
            found["coverage"][name] = coverage_table(test, calibration)
            found["bands"][name] = band_parts(test, calibration, level)
        found["trend"][name] = trend_table(test, random_stream(seed, f"trend.{name}"))
        if is_regular(groups, name):
            found["response"][name] = regular_response(groups, name)
    lost = lost_forecasts(groups, settings.tests)
    out = {} if lost is None else {"statistics/lost": lost}
    for key, tables in found.items():
        if made := {name: each for name, each in tables.items() if each is not None}:
            names = xr.Variable("test", list(made))
            out[f"statistics/{key}"] = xr.concat(list(made.values()), names, join="outer")
    name = settings.statistics.densities_of or next(iter(settings.tests))
    test = groups[f"tests/{name}"]
    models = list(settings.models)
    pairs = [_divergences(test, model, channels, settings, name, executor) for model in models]
    divergence, densities = (
        xr.concat([pair[k] for pair in pairs], dim=xr.Variable("model", models)) for k in (0, 1)
    )
    out["statistics/divergence"] = divergence.assign_attrs(test=name)
    out["statistics/densities"] = densities.assign_attrs(test=name)
    return out


def lost_forecasts(groups: Mapping[str, xr.Dataset], tests: Iterable[str]) -> xr.Dataset | None:
    """Cells without a whole forecast, which are left out; of ensembles, all members were lost."""
    rows = []
    for name in tests:
        test = groups[f"tests/{name}"]
        runs, starts = test["run"].values.astype(str), test["start"].values
        gone = np.isnan(test["mean"].values).any(axis=(3, 4)) & test["judged"].values
        for m, k, w in zip(*np.nonzero(gone), strict=True):
            model, training = str(test["model"].values[m]), str(test["training"].values[k])
            rows.append((model, name, training, int(w), runs[w], float(starts[w])))
    if not rows:
        return None
    keys = ("model", "test", "training", "window", "run", "start")
    columns = dict(zip(keys, map(list, zip(*rows, strict=True)), strict=True))
    return xr.Dataset({key: ("cell", values) for key, values in columns.items()})


def words_of_lost(lost: xr.Dataset) -> str:
    """One sentence that names model, training set and window of each lost forecast."""
    cells = list(lost.to_dataframe().itertuples())
    named = [
        f"model '{each.model}', training set '{each.training}', window {each.window} of "
        f"'{each.test}' ({each.run} from {each.start:.6g} s)"
        for each in cells[:SHOWN]
    ]
    more = f"; and {len(cells) - SHOWN} more, in statistics/lost" if len(cells) > SHOWN else ""
    return (
        f"{len(cells)} forecast(s) diverged and are left out: {'; '.join(named)}{more}. A larger "
        "ridge, fewer delays or more training data make a model stable."
    )


def _columns(
    names: Sequence[str], dims: tuple[str, ...], values: Iterable[FloatArray]
) -> dict[str, tuple[tuple[str, ...], FloatArray]]:
    """Variables of a table, one per row of `values`."""
    return {name: (dims, each) for name, each in zip(names, values, strict=True)}


def difference_table(
    test: xr.Dataset, training: xr.Dataset, rng: np.random.Generator
) -> xr.Dataset:
    """Change of the median error from one model to another, with its interval.

    ``change`` over (model, other, measure, channel) is the median error over all cells over that of
    the other model, minus one: −0.2 is better by 20 %. ``lower`` and ``upper`` come from a two-way
    block bootstrap over training sets and test windows
    (:func:`seakeep.statistics.two_way_interval`); ``blocks`` of each that overlap are drawn
    together. Where the interval holds zero the study cannot tell (:func:`verdict`).
    """
    order, _ = training_order(training)
    blocks = blocks_of([test], training)
    judged = test["judged"].values[order]
    errors = test["error"].transpose("training", "window", "model", "measure", "channel")
    cells: FloatArray = errors.values[order]
    cells = np.concatenate([average_of(cells)[..., None], cells], axis=-1)
    cells = np.where(judged[..., None, None, None], cells, np.nan)

    def ratio(drawn: FloatArray) -> FloatArray:
        middle = median_of(drawn.reshape(len(drawn), -1, *drawn.shape[3:]))
        with np.errstate(divide="ignore", invalid="ignore"):
            out: FloatArray = middle[:, :, None] / middle[:, None]
        return out

    found = ratio(cells[None])[0]
    bounds = statistics.two_way_interval(ratio, cells, rng=rng, blocks=blocks, n_series=DIFFERENCES)
    changes = [values - 1.0 for values in (found, *bounds)]
    dims = ("model", "other", "measure", "channel")
    return xr.Dataset(
        _columns(("change", "lower", "upper"), dims, changes),
        coords={
            "model": test["model"].values,
            "other": test["model"].values,
            "measure": test["measure"].values,
            "channel": ["average", *map(str, test["channel"].values)],
        },
    )


def blocks_of(tests: Sequence[xr.Dataset], training: xr.Dataset) -> tuple[int, int]:
    """How many neighbours overlap: training sets, and windows of test sets one after the other."""
    spans: list[tuple[str, float, float]] = []
    for test in tests:
        ends = test["start"].values + float(test["time"].values[-1])
        spans += zip(test["run"].values.astype(str), test["start"].values, ends, strict=True)
    return training_order(training)[1], statistics.overlap_block(spans)


def training_order(training: xr.Dataset) -> tuple[npt.NDArray[np.intp], int]:
    """Training sets in the order of their instants, and how many neighbours overlap."""
    count = training.sizes["training"]
    if "run" not in training:
        return np.arange(count), 1
    runs, stops = training["run"].values.astype(str), training["stop"].values
    reads = training["reads"].values
    spans = list(zip(runs, stops - reads, stops, strict=True))
    return np.lexsort((stops, runs)), statistics.overlap_block(spans)


def median_of(cells: FloatArray) -> FloatArray:
    """Median along the second axis, NaN left out."""
    ordered = np.sort(cells, axis=1)  # NaN last
    count = np.isfinite(ordered).sum(axis=1, keepdims=True)
    low, high = np.maximum(count - 1, 0) // 2, count // 2
    both = [
        np.take_along_axis(ordered, np.minimum(at, cells.shape[1] - 1), axis=1)
        for at in (low, high)
    ]
    out: FloatArray = np.where(count > 0, 0.5 * (both[0] + both[1]), np.nan)[:, 0]
    return out


def verdict(lower: float, upper: float) -> Literal["better", "worse", "cannot tell"]:
    """What an interval of a change of error says: a smaller error is better.

    Examples
    --------
    >>> verdict(-0.2, -0.1), verdict(-0.1, 0.2)
    ('better', 'cannot tell')
    """
    if upper < 0:
        return "better"
    return "worse" if lower > 0 else "cannot tell"


def skill_table(
    boxes: xr.Dataset, differences: xr.Dataset, kinds: Mapping[str, str]
) -> xr.Dataset | None:
    """How much smaller the median error of each model is than that of the baselines in the study.

    ``change``, ``lower`` and ``upper`` over (model, reference, measure) are those of
    :func:`difference_table` for the average over the channels. References are ``hold_last``,
    ``mean`` and ``best_linear``, the linear baseline of least median ANRMSE; None if there are
    none.
    """
    median = boxes["median"].sel(channel="average", drop=True)
    named = {}
    for name, among in references_of(kinds).items():
        errors = {model: float(median.sel(model=model, measure="nrmse")) for model in among}
        if known := {model: error for model, error in errors.items() if np.isfinite(error)}:
            named[name] = min(known, key=known.__getitem__)
    if not named:
        return None
    out = differences.sel(channel="average", other=list(named.values()), drop=True)
    out = out.rename(other="reference").assign_coords(reference=list(named))
    return out.assign(reference_model=("reference", list(named.values())))


def references_of(kinds: Mapping[str, str]) -> dict[str, list[str]]:
    """Names of the references among models of some kinds, those of one sort together."""
    out: dict[str, list[str]] = {}
    for model, kind in sorted(kinds.items(), key=lambda each: each[1] not in CONSTANT):
        if KINDS[kind].role == "reference":
            out.setdefault(kind if kind in CONSTANT else "best_linear", []).append(model)
    return out


def box_table(test: xr.Dataset) -> xr.Dataset:
    """Quartiles of the errors over all cells of a test set, over (model, measure, channel).

    The channel ``average`` is the paper's ANRMSE and NAMMAE: the average of each cell over the
    channels that can be judged. ``training_nrmse`` counts the error in SD of the training, also
    that of a channel that barely moves.
    """
    numbers = (
        "median",
        "lower_quartile",
        "upper_quartile",
        "lower_whisker",
        "upper_whisker",
        "mean",
        "count",
        "left_out",
    )
    names = ["average", *map(str, test["channel"].values)]
    errors = test["error"].values[:, :, test["judged"].values]  # (model, measure, cell, channel)
    values = np.full((len(numbers), *errors.shape[:2], len(names)), np.nan)
    for m, k in np.ndindex(errors.shape[:2]):
        columns = [average_of(errors[m, k]), *errors[m, k].T]
        for c, column in enumerate(columns):
            try:
                box = statistics.box_statistics(column)
            except DataError:  # never judged: a line that is slack in all windows
                values[-2:, m, k, c] = 0, column.size
                continue
            values[:, m, k, c] = [getattr(box, number) for number in numbers]
    return xr.Dataset(
        _columns(numbers, ("model", "measure", "channel"), values),
        coords={"model": test["model"], "measure": test["measure"], "channel": names},
    )


def average_of(cells: FloatArray) -> FloatArray:
    """Average of cells (cell, channel) over the judged channels; NaN where a forecast diverged."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the mean of nothing is NaN, as wanted
        out: FloatArray = np.nanmean(cells, axis=-1)
    return out


def coverage_table(test: xr.Dataset, calibration: xr.Dataset | None = None) -> xr.Dataset:
    """Fraction of the instants at which the band holds the measurement, and the truth where known.

    Over (model, against, channel), averages over all cells. With a calibration, the same of the
    calibrated band: ``calibrated_inside`` and so on.
    """
    sides = ["measured", *(["truth"] if "truth" in test else [])]
    numbers = ("inside", "below", "above", "relative_width")
    names = ["average", *map(str, test["channel"].values)]
    judged, ensembles = test["judged"].values, test["ensemble"].values
    variables: dict[str, Any] = {}
    bands = {"": None} if calibration is None else {"": None, "calibrated_": calibration}
    for prefix, band in bands.items():
        values = np.full((len(numbers), len(ensembles), len(sides), len(names)), np.nan)
        for m, model in enumerate(ensembles):
            lower, upper = (bound[judged] for bound in band_of(test, model, band))
            for s, side in enumerate(sides):
                values[:, m, s] = _coverage_row(test, side, lower, upper, numbers)
        keys = [prefix + number for number in numbers]
        variables |= _columns(keys, ("model", "against", "channel"), values)
    return xr.Dataset(variables, coords={"model": ensembles, "against": sides, "channel": names})


def band_parts(test: xr.Dataset, calibration: xr.Dataset | None, level: float) -> xr.Dataset | None:
    """Coverage, width, Winkler score and CRPS of bands over (model, band, part, channel).

    Parts are all instants, thirds by wave height, and thirds of the horizon; None where no band
    can be judged.
    """
    judged, ensembles = test["judged"].values, test["ensemble"].values
    shape = (*judged.shape, *test["measured"].shape[1:])
    measured = np.broadcast_to(test["measured"].values, shape)[judged]
    waves = None
    if "wave_height" in test and np.isfinite(test["wave_height"]).all():
        waves = np.broadcast_to(test["wave_height"].values, shape[:-1])[judged]
    numbers = ("inside", "width", "relative_width", "winkler", "crps")
    bands = ("members",) if calibration is None else ("members", "calibrated")
    tables: dict[tuple[int, int], CoverageTable] = {}
    for m, model in enumerate(ensembles):
        for b, found in enumerate((None, calibration)[: len(bands)]):
            lower, upper = (bound[judged] for bound in band_of(test, model, found))
            if np.isnan(lower).any(axis=(1, 2)).all():
                continue  # lost everywhere, or nothing to calibrate on
            tables[m, b] = statistics.coverage_table(lower, upper, measured, level, waves)
    if not tables:
        return None
    parts = next(iter(tables.values())).parts
    names = list(test["channel"].values)
    values = np.full((len(numbers), len(ensembles), len(bands), len(parts), len(names)), np.nan)
    for (m, b), table in tables.items():
        values[:, m, b] = [getattr(table, number) for number in numbers]
    return xr.Dataset(
        _columns(numbers, ("model", "band", "part", "channel"), values),
        coords={
            "model": ensembles,
            "band": list(bands),
            "part": list(parts),
            "channel": names,
        },
    )


def band_of(
    test: xr.Dataset, model: str, calibration: xr.Dataset | None
) -> tuple[FloatArray, FloatArray]:
    """Bounds of a band in a test set, (training, window, time, channel): calibrated, or not."""
    test = test.sel(ensemble=model)
    lower, upper = test["lower"].values, test["upper"].values
    if calibration is None:
        return lower, upper
    mean, std = test["mean"].sel(model=model).values, test["std"].values
    calibration = calibration.sel(ensemble=model)
    margin = calibration["margin"].values[:, None, None, :]
    scale = None
    if "law" in calibration:
        laws = (calibration["floor"].values, calibration["law"].values)
        each = zip(std, *laws, test["envelope"].values, strict=True)
        scale = np.stack([band_scale(*row) for row in each])
    elif "floor" in calibration:
        scale = band_scale(std, calibration["floor"].values[:, None, None, :])
    return calibrated_bounds(mean, lower, upper, margin, scale)


def _coverage_row(
    test: xr.Dataset, side: str, lower: FloatArray, upper: FloatArray, numbers: Sequence[str]
) -> FloatArray:
    """Coverage over the judged cells, shape (number, 1 + channel): the average first."""
    judged = test["judged"].values
    against = np.broadcast_to(test[side].values, (*judged.shape, *test[side].shape[1:]))
    known = np.isfinite(against).all(axis=(0, 1, 2))
    band = statistics.coverage(lower, upper, np.where(known, against, 0.0)[judged])
    rows = []
    for number in numbers:
        each = getattr(band, number)
        each = np.where(known & np.isfinite(each), each, np.nan)
        rows.append([average_of(average_of(each)), *average_of(each.T)])
    return np.array(rows)


def trend_table(test: xr.Dataset, rng: np.random.Generator) -> xr.Dataset:
    """Test whether ε(t), averaged over all cells, grows with the age of the forecast."""
    numbers = ("slope", "lower", "upper", "change", "kendall_tau", "p_value", "block_length")
    names = ("error_mean", "lower_quartile", "upper_quartile")
    time, shape = test["time"].values, (test.sizes["band"], test.sizes["model"])
    found = np.full((len(numbers), *shape), np.nan)
    series = np.full((len(names), *shape, time.size), np.nan)
    errors = test["error_over_time"].values[:, :, test["judged"].values]
    for b, m in np.ndindex(shape):
        cells = errors[m, b][np.isfinite(errors[m, b]).all(axis=1)]
        if not len(cells):
            continue
        series[:, b, m] = cells.mean(axis=0), *np.quantile(cells, [0.25, 0.75], axis=0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SeakeepWarning)  # the block length is in the table
            trend = statistics.trend_test(
                series[0, b, m], rng=rng, time=time, n_series=TREND_SERIES
            )
        found[:, b, m] = [getattr(trend, number) for number in numbers]
    return xr.Dataset(
        _columns(numbers, ("band", "model"), found)
        | _columns(names, ("band", "model", "time"), series),
        coords={"band": test["band"].values, "model": test["model"].values, "time": time},
    )


def joined(test: xr.Dataset, model: str) -> tuple[FloatArray, FloatArray, int]:
    """Forecasts of the windows of a test set joined end to end, and the measurement.

    Forecasts have the shape (series, time, channel): one series per training set that may test all
    windows; where none may (runs are left out), the k-th series takes each window's k-th training
    set. A series in which a forecast diverged is left out; their number comes last.
    """
    judged = test["judged"].values
    mean = test["mean"].sel(model=model).values
    count = int(judged.sum(axis=0).min())
    rows = np.argsort(~judged, axis=0, kind="stable")[:count]
    windows = np.arange(judged.shape[1])
    picked = np.stack([mean[row, windows] for row in rows])
    picked = picked.reshape(count, -1, mean.shape[-1])
    whole = np.isfinite(picked).all(axis=(1, 2))
    measured = test["measured"].values.reshape(-1, mean.shape[-1])
    return picked[whole], measured, int(np.count_nonzero(~whole))


DIVERGENCE = (
    "mean", "lower", "upper", "uncertainty", "of_series", "noise_floor",
    "noise_floor_lower", "noise_floor_upper", "block_length",
)  # fmt: skip


def _divergences(
    test: xr.Dataset,
    model: str,
    channels: Sequence[str],
    settings: StudySettings,
    name: str,
    executor: Executor | None,
) -> tuple[xr.Dataset, xr.Dataset]:
    predicted, measured, diverged = joined(test, model)
    segments = [test.sizes["time"]] * test.sizes["window"]
    table = np.full((len(DIVERGENCE), len(VARIANTS), len(channels)), np.nan)
    curves = np.full((7, len(channels), 512), np.nan)
    inside = predicted.reshape(len(predicted), len(segments), segments[0], len(channels))
    moves = (np.ptp(inside, axis=2).max(axis=1) > 0).all(axis=0) & (np.ptp(measured, axis=0) > 0)
    # What stands still has no density.
    judged = np.flatnonzero(moves if len(predicted) else []).tolist()
    # Contiguous, as they are in a worker: sums are then the same to the last bit.
    items = [(channels[c], predicted[:, :, c].copy("C"), measured[:, c].copy()) for c in judged]
    found = in_order(_channel_densities, (settings, name, segments), items, executor)
    for c, each in zip(judged, found, strict=True):
        if isinstance(each, str):  # a series that stands still has no density
            warn(
                f"the densities of {channels[c]} as forecast by '{model}' and as measured, over "
                f"the windows of '{name}', cannot be compared and are left out: {each}"
            )
        else:
            table[:, :, c], curves[:, c] = each
    divergence = xr.Dataset(
        _columns(DIVERGENCE, ("variant", "channel"), table),
        coords={"variant": list(VARIANTS), "channel": list(channels)},
    )
    divergence["diverged_series"] = diverged
    keys = ("value", *(f"{side}_{k}" for side in ("measured", "predicted")
                       for k in ("mean", "lower", "upper")))  # fmt: skip
    densities = xr.Dataset(
        _columns(keys, ("channel", "grid"), curves),
        coords={"channel": list(channels)},
    )
    return divergence, densities


def _channel_densities(
    data: tuple[StudySettings, str, Sequence[int]], item: tuple[str, FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray] | str:
    """Divergences and densities of one channel of one model, or why there are none."""
    settings, name, segments = data
    channel, p, m = item
    found = {}
    try:
        with warnings.catch_warnings():
            # Caps of the block length and coarse grids: the table prints the length.
            warnings.simplefilter("ignore", SeakeepWarning)
            for variant, choice in VARIANTS.items():
                found[variant] = statistics.jsd_interval(
                    p,
                    m,
                    block_length=choice["block_length"],
                    bandwidth=choice["bandwidth"],
                    segments=None if choice["joins"] else segments,
                    rng=random_stream(settings.study.seed, f"jsd.{name}.{variant}.{channel}"),
                    n_series=settings.statistics.n_series,
                )
    except (DataError, RequestError) as error:
        return str(error)
    paper, beyond = found["paper"], (1 - settings.statistics.level) / 2
    curves = [paper.grid]
    for drawn in (paper.measured, paper.predicted.reshape(-1, paper.grid.size)):
        curves += [drawn.mean(axis=0), *np.quantile(drawn, [beyond, 1 - beyond], axis=0)]
    table = [[getattr(each, number) for each in found.values()] for number in DIVERGENCE]
    return np.array(table), np.stack(curves)


def wave_frequency(elevation: npt.ArrayLike, dt: float) -> float:
    """Frequency of a regular wave, Hz: the peak of its spectrum, interpolated.

    Parameters
    ----------
    elevation : array_like, shape (time,)
        A record of several periods.
    dt : float
        Time step, s.

    Returns
    -------
    float
        To about a hundredth of one over the length of the record.

    Examples
    --------
    >>> t = np.arange(1200) * 0.05
    >>> round(wave_frequency(np.sin(2 * np.pi * 0.8586 * t), 0.05), 4)
    0.8586
    """
    x = np.asarray(elevation, dtype=float)
    padded = 64 * x.size
    tapered = (x - x.mean()) * np.hanning(x.size)
    spectrum = np.abs(np.fft.rfft(tapered, padded))
    return float(np.argmax(spectrum) / (padded * dt))


def is_regular(groups: Mapping[str, xr.Dataset], test: str) -> bool:
    """Whether all windows of a test set lie in runs of regular waves of known frequency."""
    names = [str(run) for run in groups[f"tests/{test}"]["run"].values]
    return bool(np.isfinite(groups["runs"]["wave_frequency"].sel(run=names)).all())


def regular_response(groups: Mapping[str, xr.Dataset], test: str) -> xr.Dataset:
    """Take the error of a test set in regular waves apart.

    ``error_offset``, ``error_wave`` and ``error_rest`` are root mean squares over cells in measured
    SDs, whose squares add up to that of the NRMSE; ``phase_lead`` is that of the forecast before
    the measurement, degrees.
    """
    data = groups[f"tests/{test}"]
    parts = np.array([_parts(groups, test, model) for model in data["model"].values])
    keys = ("error_offset", "error_wave", "error_rest", "amplitude_ratio", "phase_lead")
    return xr.Dataset(
        _columns(keys, ("model", "channel"), parts.swapaxes(0, 1)),
        coords={"model": data["model"], "channel": data["channel"]},
    )


def _parts(groups: Mapping[str, xr.Dataset], test: str, model: str) -> list[FloatArray]:
    """Errors and responses of a model, each of shape (channel,)."""
    judged = groups[f"tests/{test}"]["judged"].values
    squares, responses = _responses(groups, test, model)
    known, answer = squares[:, judged], responses[judged]
    lost = np.isnan(known).all(axis=(0, 1))
    known[..., lost], answer[..., lost] = 0.0, 1.0
    errors = np.sqrt(np.nanmean(np.maximum(known, 0.0), axis=1))
    with warnings.catch_warnings(), np.errstate(invalid="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # a constant forecast has no phase
        direction = np.nanmean(answer / np.abs(answer), axis=0)
    columns_of = [*errors, np.nanmedian(np.abs(answer), axis=0), np.degrees(np.angle(direction))]
    return [np.where(lost, np.nan, each) for each in columns_of]


def _responses(
    groups: Mapping[str, xr.Dataset], test: str, model: str
) -> tuple[FloatArray, npt.NDArray[np.complex128]]:
    """:func:`_in_waves` over (training, window, channel); NaN where one is not judged."""
    data = groups[f"tests/{test}"]
    frequencies = groups["runs"]["wave_frequency"].sel(run=data["run"].values.astype(str)).values
    time, measured = data["time"].values, data["measured"].values
    one = data.sel(model=model, measure="nrmse")
    forecasts, slack = one["mean"].values, np.isnan(one["error"].values)
    squares = np.full((3, *slack.shape), np.nan)
    responses = np.full(slack.shape, np.nan, dtype=complex)
    for cell in zip(*np.nonzero(data["judged"].values), strict=True):
        place = frequencies[cell[1]], forecasts[cell], measured[cell[1]]
        squares[:, *cell], responses[cell] = _in_waves(time, *place)
    squares[:, slack], responses[slack] = np.nan, np.nan
    return squares, responses


def _in_waves(
    time: FloatArray, frequency: float, predicted: FloatArray, truth: FloatArray
) -> tuple[FloatArray, npt.NDArray[np.complex128]]:
    """Squared error by parts, shape (3, channel), and forecast over measurement in the wave."""
    turn = 2 * np.pi * frequency * time
    basis = np.stack([np.ones_like(time), np.cos(turn), np.sin(turn)], axis=1)
    orthonormal, triangle = np.linalg.qr(basis)
    error = predicted - truth
    inside = (orthonormal.T @ error) ** 2
    total = np.sum(error**2, axis=0)
    found = np.stack([inside[0], inside[1:].sum(axis=0), total - inside.sum(axis=0)])
    found /= time.size * truth.var(axis=0, ddof=1)
    # The first of an orthonormal basis of (1, cos, sin) is the mean; amplitudes need (1, …).
    complex_of = [np.linalg.solve(triangle, orthonormal.T @ each) for each in (predicted, truth)]
    return found, np.divide(*[each[1] - 1j * each[2] for each in complex_of])


def phase_leads(groups: Mapping[str, xr.Dataset], test: str, model: str) -> FloatArray:
    """Phase of the forecast before the measurement, degrees, over (training, window, channel).

    NaN where a cell or a channel is not judged.
    """
    return np.degrees(np.angle(_responses(groups, test, model)[1]))
