"""Statistics of a study: boxes, divergences, coverage and trend, as the paper and as recommended.

The paper joins the test windows of a model's (mean) forecast and of the measurement, bootstraps
the joined series in blocks that may cross a join, and takes the bandwidth and the block length as
printed. The recommended variant lets no block cross a join, and takes Silverman's bandwidth and
the block length of Politis and White.
"""

import warnings
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep import statistics
from seakeep.arrays import ComplexArray, Datasets, FloatArray, Groups, IntArray, undefined
from seakeep.core.bands import band_scale, calibrated_bounds
from seakeep.core.density import NUMBERS, jsd_intervals
from seakeep.core.spectra import split_bands
from seakeep.errors import DataError, SeakeepError, quiet, warn
from seakeep.executor import in_order
from seakeep.metrics import extremes_error, over_channels, paired, root_mean_square
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
FAR = 5.0
"""Range of a forecast, in those of the measurement, from which on its densities stand apart."""
SHOWN = 5
"""Lost forecasts that a warning names."""
Statistic = Callable[..., FloatArray]
DIFFERENCES = 500
"""Redrawn tables of cells for the interval of a difference between models."""


def judge_windows(*, dt: float, frequency: float, **pair: Any) -> xr.Dataset:
    """(Mean) forecasts of windows with their errors; bands meet at `frequency`.

    Parameters
    ----------
    predicted, measured : ndarray, shape (window, time, N)
        In the same units.
    training_std, noise_std : array_like, shape (N,) and (window, N)
        As :func:`seakeep.metrics.nrmse`.

    Returns
    -------
    Dataset
        ``mean``; ``error`` over (measure, window, channel), NaN where a channel is not judged and
        infinite where the forecast diverged; ``error_over_time`` over (band, window, time), and
        over (band, window, channel) the mean of a channel's ε(t), ``level``, and ``growth``: its
        change over the window along the line of least squares.
    """
    both = paired(**pair)
    p, m, _, spread, judged = both
    lost = np.isnan(p).any(axis=(-2, -1), keepdims=True)
    endless = both._replace(p=np.where(lost, np.inf, p))
    size = root_mean_square(endless.p - m)
    errors = [size / spread, extremes_error(endless), size / np.asarray(pair["training_std"])]
    parts = np.stack([p - m, *split_bands(p - m, dt, frequency)])
    absolute = np.abs(parts) / spread[..., None, :]
    age = np.linspace(-0.5, 0.5, p.shape[-2])
    lines = np.einsum("t,...tc->...c", age / (age @ age), absolute)
    by_channel = ("band", "window", "channel")
    over_time = over_channels(absolute, judged[..., None, :])
    return xr.Dataset(
        {
            "mean": (("window", "time", "channel"), p),
            "error": (("measure", "window", "channel"), np.stack(errors)),
            "error_over_time": (("band", "window", "time"), over_time),
            "level": (by_channel, absolute.mean(axis=-2)),
            "growth": (by_channel, lines),
        }
    )


def judge(
    groups: Datasets,
    settings: StudySettings,
    channels: Sequence[str],
    executor: Executor | None = None,
) -> Groups:
    """All statistics of a study, as groups ``statistics/…``; the densities side by side."""
    seed = settings.study.seed
    tables: dict[str, Groups] = defaultdict(dict)
    for name in settings.tests:
        test = groups[f"tests/{name}"]
        rng = random_stream(seed, f"differences.{name}")
        of_test = {
            "boxes": box_table(test),
            "differences": difference_table(test, groups["training"], rng),
            **band_tables(test, groups.get("calibration"), settings.statistics.level),
            "trend": trend_table(test, groups["training"], random_stream(seed, f"trend.{name}")),
        }
        if is_regular(groups, name):
            of_test["response"] = regular_response(groups, name)
        for key, each in of_test.items():
            tables[key][name] = each
    out = {
        key: xr.concat(list(of.values()), xr.Variable("test", list(of)), join="outer")
        for key, of in tables.items()
    }
    if (lost := lost_forecasts(groups, settings.tests)) is not None:
        out["lost"] = lost
    name = settings.statistics.densities_of or next(iter(settings.tests))
    out |= density_tables(groups[f"tests/{name}"], channels, settings, name, executor)
    return {f"statistics/{key}": each for key, each in out.items()}


def lost_forecasts(groups: Datasets, tests: Iterable[str]) -> xr.Dataset | None:
    """Cells without a whole forecast; of ensembles, all members were lost."""
    rows = []
    for name in tests:
        test = groups[f"tests/{name}"]
        gone = test["mean"].isnull().any(("time", "channel")) & test["judged"]
        for model, training, window in np.argwhere(gone.values):
            at = test.isel(model=model, training=training, window=window)
            keys = ("model", "training", "window", "run", "start")
            rows.append({key: at[key].item() for key in keys} | {"test": name})
    return along("cell", rows) if rows else None


def along(dim: str, rows: Sequence[Mapping[str, Any]]) -> xr.Dataset:
    """Rows of the same keys as variables along a dimension, which may be one of them."""
    return xr.Dataset({key: (dim, [row[key] for row in rows]) for key in rows[0]})


def side_by_side(
    grid: Sequence[Sequence[xr.Dataset]], names: Mapping[str, Any], fill: Any = np.nan
) -> xr.Dataset:
    """Datasets over two new dimensions, first that of the rows."""
    out = xr.combine_nested(
        grid, list(names), coords="minimal", join="outer", combine_attrs="override", fill_value=fill
    ).assign_coords(names)
    return out.transpose(*names, ...)


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
        f"{len(cells)} forecast(s) diverged: {'; '.join(named)}{more}. Their errors count as "
        "infinite in medians, quartiles and differences; all else leaves them out. A larger ridge, "
        "fewer delays or more training data make a model stable."
    )


def numbered(
    values: npt.ArrayLike, dims: tuple[str, ...], numbers: Sequence[str], coords: Mapping[str, Any]
) -> xr.Dataset:
    """An array as a Dataset, one variable per entry of its dimension ``number``."""
    return xr.DataArray(values, {"number": list(numbers), **coords}, dims).to_dataset("number")


def difference_table(
    test: xr.Dataset, training: xr.Dataset, rng: np.random.Generator
) -> xr.Dataset:
    """Change of the median error from one model to another, with its interval.

    ``change`` over (model, other, measure, channel) is the median error over all cells over that of
    the other model, minus one: −0.2 is better by 20 %; NaN of models that both diverge in more than
    half of the cells. ``lower`` and ``upper`` come from a two-way block bootstrap over training
    sets and test windows (:func:`seakeep.statistics.two_way_interval`); ``blocks`` of each that
    overlap are drawn together. Where the interval holds zero the study cannot tell.
    """
    order, _ = training_order(training)
    blocks = blocks_of([test], training)
    errors = test["error"].transpose("training", "window", "model", "measure", "channel")
    cells = with_average(errors.where(test["judged"]).values[order])

    def ratio(drawn: FloatArray) -> FloatArray:
        middle = median_of(drawn.reshape(len(drawn), -1, *drawn.shape[3:]))
        with undefined():
            return np.log(middle[:, :, None] / middle[:, None])

    coords = {
        "model": test["model"].values,
        "other": test["model"].values,
        "measure": test["measure"].values,
        "channel": _names(test),
    }
    change = with_bounds(ratio, cells, rng=rng, blocks=blocks, n_series=DIFFERENCES, signed=True)
    out = numbered(np.exp(change) - 1.0, ("number", *coords), ("change", "lower", "upper"), coords)
    for key, words in {"change": "", "lower": ", lower bound", "upper": ", upper bound"}.items():
        out[key].attrs["long_name"] = f"median error of model over that of other, minus one{words}"
    return out


def with_bounds(statistic: Statistic, *cells: FloatArray, **how: Any) -> FloatArray:
    """A statistic of crossed cells and its bounds, shape (3, …).

    Arguments are those of :func:`seakeep.statistics.two_way_interval`.
    """
    bounds = statistics.two_way_interval(statistic, *cells, **how)
    return np.stack([statistic(*(each[None] for each in cells))[0], *bounds])


def _names(test: xr.Dataset) -> list[str]:
    """Channels of a table: their average first."""
    return ["average", *map(str, test["channel"].values)]


def average_of(cells: FloatArray) -> FloatArray:
    """Average of cells (…, channel) over the judged channels."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the mean of nothing is NaN, as wanted
        return np.nanmean(cells, axis=-1)


def with_average(cells: FloatArray) -> FloatArray:
    """Cells (…, channel) with their average before the first channel."""
    return np.concatenate([average_of(cells)[..., None], cells], axis=-1)


def blocks_of(tests: Sequence[xr.Dataset], training: xr.Dataset) -> tuple[int, int]:
    """How many neighbours overlap: training sets, and windows of test sets one after the other."""
    spans = [span for test in tests for span in window_spans(test)]
    return training_order(training)[1], statistics.overlap_block(spans)


def window_spans(test: xr.Dataset) -> list[tuple[str, float, float]]:
    """Run, start and end (s) of each window of a test set."""
    runs, starts = test["run"].values.astype(str), test["start"].values
    return list(zip(runs, starts, starts + float(test["time"].values[-1]), strict=True))


def training_order(training: xr.Dataset) -> tuple[IntArray, int]:
    """Training sets in the order of their instants, and how many neighbours overlap."""
    if "run" not in training:
        return np.arange(training.sizes["training"]), 1
    runs, stops = training["run"].values.astype(str), training["stop"].values
    spans = list(zip(runs, stops - training["reads"].values, stops, strict=True))
    return np.lexsort((stops, runs)), statistics.overlap_block(spans)


def median_of(cells: FloatArray) -> FloatArray:
    """Median along the second axis, NaN left out: a tenth of the time of ``nanmedian``."""
    ordered = np.sort(cells, axis=1)  # NaN last, and first where there is nothing else
    count = (~np.isnan(ordered)).sum(axis=1, keepdims=True)
    low, high = np.maximum(count - 1, 0) // 2, count // 2
    pair = np.take_along_axis(ordered, np.concatenate([low, high], axis=1), axis=1)
    return pair.mean(axis=1)


BOX = (
    "median", "lower_quartile", "upper_quartile", "lower_whisker", "upper_whisker", "mean",
    "count", "left_out",
)  # fmt: skip


def box_table(test: xr.Dataset) -> xr.Dataset:
    """Quartiles of the errors over all cells of a test set, over (model, measure, channel).

    The channel ``average`` is the paper's ANRMSE and NAMMAE: the average of each cell over the
    channels that can be judged. ``training_nrmse`` counts the error in SD of the training, also
    that of a channel that barely moves.
    """

    def box(column: FloatArray) -> list[float]:
        try:
            numbers = statistics.box_statistics(column)
        except DataError:  # never judged: a line that is slack in all windows
            return [np.nan] * (len(BOX) - 2) + [0, column.size]
        return [getattr(numbers, number) for number in BOX]

    cells = with_average(test["error"].values[:, :, test["judged"].values])
    coords = {"model": test["model"], "measure": test["measure"], "channel": _names(test)}
    values = np.apply_along_axis(box, 2, cells)  # (model, measure, number, channel)
    return numbered(values, ("model", "measure", "number", "channel"), BOX, coords)


COVERAGE = ("inside", "below", "above", "relative_width")
PARTS = ("inside", "width", "relative_width", "winkler", "crps")


def band_tables(test: xr.Dataset, calibration: xr.Dataset | None, level: float) -> Groups:
    """How bands hold the measurement; empty without ensembles.

    ``coverage`` over (model, band, against, channel) is the fraction of the instants at which a
    band holds the measurement, and the truth where it is known, averages over all cells; the band
    is that of the members or, with a calibration, the calibrated one too. ``bands`` over
    (model, band, part, channel) has coverage, width, Winkler score and CRPS of all instants, of
    thirds by wave height, and of thirds of the horizon; it is left out where no band can be judged.
    """
    ensembles, judged = test["ensemble"].values, test["judged"].values
    if not ensembles.size:
        return {}

    def cells(key: str) -> FloatArray:
        values = test[key].values
        return np.broadcast_to(values, (*judged.shape, *values.shape[1:]))[judged]

    against = {key: cells(key) for key in ("measured", "truth") if key in test}
    waves = cells("wave_height") if "wave_height" in test else None
    bands = {"members": None} | ({} if calibration is None else {"calibrated": calibration})
    over = {"against": list(against), "channel": _names(test)}
    tables: dict[str, list[xr.Dataset]] = defaultdict(list)
    for model, band in product(ensembles, bands):
        place = {"model": [model], "band": [band]}
        lower, upper = (bound[judged] for bound in band_of(test, model, bands[band]))
        shares = [_coverage_row(lower, upper, each) for each in against.values()]
        held = numbered(shares, ("against", "number", "channel"), COVERAGE, over)
        tables["coverage"].append(held.expand_dims(place))
        if not np.isnan(lower).any(axis=1).all():  # lost, or nothing to calibrate on
            scores = statistics.coverage_table(lower, upper, against["measured"], level, waves)
            within = {"part": list(scores.parts), "channel": test["channel"]}
            values = [getattr(scores, key) for key in PARTS]
            each = numbered(values, ("number", *within), PARTS, within)
            tables["bands"].append(each.expand_dims(place))
    return {
        key: xr.merge(of, join="outer", compat="no_conflicts").reindex(
            model=ensembles, band=list(bands)
        )
        for key, of in tables.items()
    }


def _coverage_row(lower: FloatArray, upper: FloatArray, against: FloatArray) -> FloatArray:
    """Coverage over the judged cells, shape (number, 1 + channel): the average first."""
    known = np.isfinite(against).all(axis=(0, 1))
    band = statistics.coverage(lower, upper, np.where(known, against, 0.0))
    each = np.stack([getattr(band, number) for number in COVERAGE])  # (number, cell, channel)
    each[~(known & np.isfinite(each))] = np.nan
    return average_of(with_average(each).swapaxes(1, 2))


def band_of(
    test: xr.Dataset, model: str, calibration: xr.Dataset | None
) -> tuple[FloatArray, FloatArray]:
    """Bounds of a band in a test set, (training, window, time, channel): calibrated, or not.

    NaN where the margin of a calibrated band is infinite: it would hold everything.
    """
    own = test.sel(ensemble=model)
    lower, upper = own["lower"].values, own["upper"].values
    if calibration is None:
        return lower, upper
    margins = calibration.sel(ensemble=model)
    scale = None
    if "floor" in margins:
        keys = [(own, "std"), (margins, "floor")]
        keys += [(margins, "law"), (own, "envelope")] if "law" in margins else []
        each = zip(*(data[key].values for data, key in keys), strict=True)
        scale = np.stack([band_scale(*of_training) for of_training in each])
    mean = test["mean"].sel(model=model).values
    margin = margins["margin"].where(np.isfinite(margins["margin"])).values
    return calibrated_bounds(mean, lower, upper, margin[:, None, None], scale)


TREND_LINES = ("error_mean", "lower_quartile", "upper_quartile")


def trend_table(test: xr.Dataset, training: xr.Dataset, rng: np.random.Generator) -> xr.Dataset:
    """How ε(t) grows with the age of the forecast.

    ``change`` over (band, model) is the growth over the window, pooled over all cells and channels,
    in parts of the mean error: 0.2 for an error that rises by a fifth of its mean. ``lower`` and
    ``upper`` come from a two-way block bootstrap over windows and channels. ``error_mean`` and its
    quartiles over the cells are over (band, model, time).
    """
    time, coords = test["time"].values, {"band": test["band"].values, "model": test["model"].values}
    series = np.full((len(coords["band"]), len(coords["model"]), 3, time.size), np.nan)
    errors = test["error_over_time"].transpose("band", "model", ...).values
    errors = errors[:, :, test["judged"].values]
    for place in np.ndindex(series.shape[:2]):
        cells = errors[place][np.isfinite(errors[place]).all(axis=1)]
        if len(cells):
            series[place] = cells.mean(axis=0), *np.quantile(cells, [0.25, 0.75], axis=0)
    level, growth = (
        test[key].where(test["judged"]).mean("training").transpose("window", "channel", *coords)
        for key in ("level", "growth")
    )

    def change(level: FloatArray, growth: FloatArray) -> FloatArray:
        with undefined():
            return np.nansum(growth, axis=(1, 2)) / np.nansum(level, axis=(1, 2))

    blocks = blocks_of([test], training)[1], 1
    values = with_bounds(
        change,
        level.values,
        growth.values,
        rng=rng,
        blocks=blocks,
        n_series=DIFFERENCES,
        signed=True,
    )
    growths = numbered(values, ("number", *coords), ("change", "lower", "upper"), coords)
    lines = numbered(series, (*coords, "number", "time"), TREND_LINES, {**coords, "time": time})
    return xr.merge([growths, lines])


def joined(test: xr.Dataset, model: str) -> tuple[FloatArray, FloatArray, int]:
    """Forecasts of the windows of a test set joined end to end, and the measurement.

    Forecasts have the shape (series, time, channel): the k-th series takes each window's k-th
    training set, from the first again where a window has fewer. A series in which a forecast
    diverged is left out; their number comes last.
    """
    sets = [np.flatnonzero(of_window) for of_window in test["judged"].values.T]
    mean = test["mean"].sel(model=model).values
    count = max(map(len, sets))
    rows = [[of_window[k % len(of_window)] for of_window in sets] for k in range(count)]
    picked = mean[rows, np.arange(len(sets))].reshape(count, -1, mean.shape[-1])
    whole = np.isfinite(picked).all(axis=(1, 2))
    measured = test["measured"].values.reshape(-1, mean.shape[-1])
    return picked[whole], measured, int(np.count_nonzero(~whole))


CURVES = (
    "value", "measured_mean", "measured_lower", "measured_upper", "predicted_mean",
    "predicted_lower", "predicted_upper",
)  # fmt: skip


def density_tables(
    test: xr.Dataset,
    channels: Sequence[str],
    settings: StudySettings,
    name: str,
    executor: Executor | None,
) -> Groups:
    """Divergences of forecasts from the measurement, and the densities, per model and channel."""
    series = [joined(test, model) for model in settings.models]
    measured = series[0][1]
    # Contiguous, as they are in a worker: sums are then the same to the last bit.
    items = [
        (channel, [predicted[..., c].copy() for predicted, *_ in series], measured[:, c].copy())
        for c, channel in enumerate(channels)
    ]
    data = settings, name, [test.sizes["time"]] * test.sizes["window"]
    tables, curves, reasons = zip(*in_order(_channel_densities, data, items, executor), strict=True)
    for reason in filter(None, reasons):
        warn(reason)
    coords = {"model": list(settings.models), "channel": list(channels)}
    both = {**coords, "variant": list(VARIANTS)}
    divergence = numbered(np.stack(tables, axis=1), (*both, "number"), NUMBERS, both)
    divergence["diverged_series"] = ("model", [lost for *_, lost in series])
    densities = numbered(np.stack(curves, axis=1), (*coords, "number", "grid"), CURVES, coords)
    return {
        "divergence": divergence.assign_attrs(test=name),
        "densities": densities.assign_attrs(test=name),
    }


def _channel_densities(
    data: tuple[StudySettings, str, Sequence[int]], item: tuple[str, list[FloatArray], FloatArray]
) -> tuple[FloatArray, FloatArray, str]:
    """Divergences and densities of one channel by model, NaN where there are none, and why."""
    settings, name, segments = data
    channel, forecasts, measured = item
    table = np.full((len(forecasts), len(VARIANTS), len(NUMBERS)), np.nan)
    curves = np.full((len(forecasts), len(CURVES), 512), np.nan)
    reason, beyond = "", (1 - settings.statistics.level) / 2
    groups = defaultdict[bool, list[int]](list)
    for m, each in enumerate(forecasts):
        moves = np.ptp(each.reshape(-1, len(segments), segments[0]), axis=2).any(axis=1)
        if moves.size and moves.all() and np.ptp(measured) > 0:  # what stands still has no density
            groups[bool(np.ptp(each) > FAR * np.ptp(measured))].append(m)
    for models in groups.values():  # those that run far away have a grid of their own
        try:
            with quiet():  # the table prints the block length
                found = [
                    jsd_intervals(
                        [forecasts[m] for m in models],
                        measured,
                        block_length=choice["block_length"],
                        bandwidth=choice["bandwidth"],
                        segments=None if choice["joins"] else segments,
                        rng=random_stream(settings.study.seed, f"jsd.{name}.{variant}.{channel}"),
                        n_series=settings.statistics.n_series,
                    )
                    for variant, choice in VARIANTS.items()
                ]
        except SeakeepError as error:
            reason = (
                f"the densities of {channel} as forecast and as measured, over the windows of "
                f"'{name}', cannot be compared and are left out: {error}"
            )
            continue
        for m, *variants in zip(models, *found, strict=True):
            table[m] = [[getattr(each, number) for number in NUMBERS] for each in variants]
            paper = variants[0]
            lines = [paper.grid]
            for drawn in (paper.measured, paper.predicted.reshape(-1, paper.grid.size)):
                lines += [drawn.mean(axis=0), *np.quantile(drawn, [beyond, 1 - beyond], axis=0)]
            curves[m] = lines
    return table, curves, reason


def is_regular(groups: Datasets, test: str) -> bool:
    """Whether all windows of a test set lie in runs of regular waves of known frequency."""
    return bool(np.isfinite(_frequencies(groups, test)).all())


def _frequencies(groups: Datasets, test: str) -> FloatArray:
    """Frequency of the regular wave in each window, Hz; NaN in other waves."""
    runs = groups[f"tests/{test}"]["run"].values.astype(str)
    return groups["runs"]["wave_frequency"].sel(run=runs).values


RESPONSE = ("error_offset", "error_wave", "error_rest", "amplitude_ratio", "phase_lead")


def regular_response(groups: Datasets, test: str) -> xr.Dataset:
    """Take the error of a test set in regular waves apart.

    ``error_offset``, ``error_wave`` and ``error_rest`` are root mean squares over cells in measured
    SDs, whose squares add up to that of the NRMSE; ``amplitude_ratio`` is the median over cells,
    and ``phase_lead`` (degrees) the circular mean of that of the forecast before the measurement.
    """
    data = groups[f"tests/{test}"]
    squares, answer = _responses(groups, test)
    with warnings.catch_warnings(), undefined():
        # A constant forecast has no phase, and nothing judged no mean.
        warnings.simplefilter("ignore", RuntimeWarning)
        errors = np.sqrt(np.nanmean(np.maximum(squares, 0.0), axis=(2, 3)))
        phase = np.degrees(np.angle(np.nanmean(answer / np.abs(answer), axis=(1, 2))))
        ratio = np.nanmedian(np.abs(answer), axis=(1, 2))
    coords = {"model": data["model"], "channel": data["channel"]}
    out = numbered([*errors, ratio, phase], ("number", "model", "channel"), RESPONSE, coords)
    words = "phase of the forecast before the measurement, circular mean over cells"
    out["phase_lead"].attrs.update(units="deg", long_name=words)
    return out


def _responses(groups: Datasets, test: str) -> tuple[FloatArray, ComplexArray]:
    """Squared error by parts, and forecast over measurement in the wave.

    Returns
    -------
    squares : ndarray, shape (3, model, training, window, channel)
        Of the offset, of the wave and of the rest; NaN where a cell or a channel is not judged.
    answer : ndarray of complex, shape (model, training, window, channel)
    """
    data = groups[f"tests/{test}"]
    time, measured, mean = (data[key].values for key in ("time", "measured", "mean"))
    turn = 2 * np.pi * _frequencies(groups, test)[:, None] * time
    basis = np.stack([np.ones_like(turn), np.cos(turn), np.sin(turn)], axis=-1)
    own, known = (np.linalg.pinv(basis) @ x for x in (mean, measured))
    error = mean - measured
    total, fitted = (np.mean(x**2, axis=-2) for x in (error, basis @ (own - known)))
    offset = error.mean(axis=-2) ** 2
    squares = np.stack([offset, fitted - offset, total - fitted]) / measured.var(axis=1, ddof=1)
    amplitudes = (each[..., 1, :] - 1j * each[..., 2, :] for each in (own, known))
    answer = np.divide(*amplitudes)
    slack = np.isnan(data["error"].sel(measure="nrmse").values)
    squares[:, slack], answer[slack] = np.nan, np.nan
    return squares, answer


def phase_leads(groups: Datasets, test: str, model: str) -> FloatArray:
    """Phase of the forecast before the measurement, degrees, over (training, window, channel).

    NaN where a cell or a channel is not judged.
    """
    place = list(groups[f"tests/{test}"]["model"].values).index(model)
    return np.degrees(np.angle(_responses(groups, test)[1][place]))
