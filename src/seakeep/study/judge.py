"""Statistics of a study: boxes, divergences, coverage and trend, as the paper and as recommended.

The paper joins the test windows of a model's (mean) forecast and of the measurement, bootstraps
the joined series in blocks that may cross a join, and takes the bandwidth and the block length as
printed. The recommended variant lets no block cross a join, and takes Silverman's bandwidth and
the block length of Politis and White.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep import statistics
from seakeep.errors import DataError, SeakeepWarning
from seakeep.study.plan import random_stream
from seakeep.study.settings import StudySettings
from seakeep.waves import phase_speed

__all__ = [
    "BAND_ERRORS",
    "VARIANTS",
    "average_of",
    "box_table",
    "coverage_table",
    "is_regular",
    "joined",
    "judge",
    "regular_response",
    "wave_frequency",
]

FloatArray = npt.NDArray[np.float64]

BAND_ERRORS = {"all": "error_over_time", "low": "error_low", "wave": "error_wave"}
"""Names of ε(t), as a whole and in its two bands."""

VARIANTS: dict[str, dict[str, Any]] = {
    "paper": {"block_length": "carlstein", "bandwidth": "paper", "joins": True},
    "recommended": {"block_length": "politis_white", "bandwidth": "silverman", "joins": False},
}
TREND_SERIES = 500
NEAR = 0.1
"""Energy within this part of a frequency counts as energy at it."""


def judge(
    groups: Mapping[str, xr.Dataset], settings: StudySettings, channels: Sequence[str]
) -> dict[str, xr.Dataset]:
    """All statistics of a study.

    Parameters
    ----------
    groups : mapping of str to Dataset
        ``tests/NAME`` with the arrays of every model, ``runs``, ``training``, ``spectra`` and,
        where bands are calibrated, ``calibration/MODEL``.
    settings : StudySettings
        The study.
    channels : sequence of str
        Channels that are forecast.

    Returns
    -------
    dict of str to Dataset
        ``statistics/boxes/TEST`` over (model, measure, channel), ``statistics/coverage/TEST``
        over (model, against, channel), ``statistics/trend/TEST`` over (band, model),
        ``statistics/response/TEST`` for regular waves (:func:`regular_response`),
        ``statistics/divergence`` over (model, variant, channel) and ``statistics/densities`` over
        (model, channel, grid).
    """
    models = list(settings.models)
    ensembles = [m for m in models if settings.models[m].kind == "bayesian_hankel_dmdc"]
    out: dict[str, xr.Dataset] = {}
    for name in settings.tests:
        test = groups[f"tests/{name}"]
        out[f"statistics/boxes/{name}"] = box_table(test, models)
        if ensembles:
            margins = {
                m: groups[f"calibration/{m}"]["margin"].values
                for m in ensembles
                if f"calibration/{m}" in groups
            }
            out[f"statistics/coverage/{name}"] = coverage_table(test, ensembles, margins)
        rng = random_stream(settings.study.seed, f"trend.{name}")
        out[f"statistics/trend/{name}"] = trend_table(test, models, rng)
        if is_regular(groups, name):
            out[f"statistics/response/{name}"] = regular_response(groups, name, models)
    name = settings.statistics.densities_of or next(iter(settings.tests))
    test = groups[f"tests/{name}"]
    found = [_divergences(test, model, channels, settings, name) for model in models]
    divergence, densities = (
        xr.concat([pair[k] for pair in found], dim=xr.Variable("model", models)) for k in (0, 1)
    )
    out["statistics/divergence"] = divergence.assign_attrs(test=name)
    out["statistics/densities"] = densities.assign_attrs(test=name)
    return out


def box_table(test: xr.Dataset, models: Sequence[str]) -> xr.Dataset:
    """Quartiles of the errors over all cells of a test set.

    Parameters
    ----------
    test : Dataset
        The set.
    models : sequence of str
        Models.

    Returns
    -------
    Dataset
        Over (model, measure, channel): ``median``, ``lower_quartile``, ``upper_quartile``,
        whiskers, ``mean``, ``count`` and ``left_out``. The channel ``average`` is the paper's
        ANRMSE and NAMMAE: the average of each cell over the channels that can be judged.
    """
    measures = ("nrmse", "nammae")
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
    values = np.full((len(numbers), len(models), len(measures), len(names)), np.nan)
    judged = test["judged"].values
    for m, model in enumerate(models):
        for k, measure in enumerate(measures):
            cells = test[f"{model}_{measure}"].values[judged]
            columns = [average_of(cells), *cells.T]
            for c, column in enumerate(columns):
                try:
                    box = statistics.box_statistics(column)
                except DataError:  # never judged: a line that is slack in all windows
                    values[-2:, m, k, c] = 0, column.size
                    continue
                values[:, m, k, c] = [getattr(box, number) for number in numbers]
    return xr.Dataset(
        {n: (("model", "measure", "channel"), values[i]) for i, n in enumerate(numbers)},
        coords={"model": list(models), "measure": list(measures), "channel": names},
    )


def average_of(cells: FloatArray) -> FloatArray:
    """Average over the channels that are judged; NaN where a forecast diverged.

    Parameters
    ----------
    cells : ndarray, shape (cell, channel)
        Errors; a channel that is not judged (slack) is NaN in single cells, a diverged forecast
        in all of its channels.

    Returns
    -------
    ndarray, shape (cell,)
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the mean of nothing is NaN, as wanted
        out: FloatArray = np.nanmean(cells, axis=-1)
    return out


def coverage_table(
    test: xr.Dataset, ensembles: Sequence[str], margins: Mapping[str, FloatArray] | None = None
) -> xr.Dataset:
    """Part of the instants at which the band holds the measurement, and the truth where known.

    Parameters
    ----------
    test : Dataset
        A test set.
    ensembles : sequence of str
        Models with a band.
    margins : mapping of str to ndarray, each of shape (training, channel), optional
        By how much the calibrated band of each is wider on either side.

    Returns
    -------
    Dataset
        Over (model, against, channel): ``inside``, ``below``, ``above``, and ``relative_width``
        in measured standard deviations, averages over all cells; channel ``average`` too. With
        margins the same of the calibrated band, ``calibrated_inside`` and so on.
    """
    sides = ["measured", *(["truth"] if "truth" in test else [])]
    numbers = ("inside", "below", "above", "relative_width")
    names = ["average", *map(str, test["channel"].values)]
    judged = test["judged"].values
    variables: dict[str, Any] = {}
    for prefix in ("", "calibrated_") if margins else ("",):
        values = np.full((len(numbers), len(ensembles), len(sides), len(names)), np.nan)
        for m, model in enumerate(ensembles):
            lower, upper = (test[f"{model}_{bound}"].values[judged] for bound in ("lower", "upper"))
            if margins and prefix:
                margin = margins[model][np.nonzero(judged)[0], None, :]
                lower, upper = lower - margin, upper + margin
            for s, side in enumerate(sides):
                values[:, m, s] = _coverage_row(test, side, lower, upper, numbers)
        variables |= {
            prefix + n: (("model", "against", "channel"), values[i]) for i, n in enumerate(numbers)
        }
    return xr.Dataset(
        variables, coords={"model": list(ensembles), "against": sides, "channel": names}
    )


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
        each = np.where(known, getattr(band, number), np.nan)
        each = np.where(np.isfinite(each), each, np.nan)
        over_cells = average_of(each)
        mean = np.nanmean(over_cells) if np.isfinite(over_cells).any() else np.nan
        rows.append([mean, *average_of(each.T)])
    return np.array(rows)


def trend_table(test: xr.Dataset, models: Sequence[str], rng: np.random.Generator) -> xr.Dataset:
    """Test whether ε(t), averaged over all cells, grows with the age of the forecast.

    Parameters
    ----------
    test : Dataset
        A test set.
    models : sequence of str
        Models.
    rng : numpy.random.Generator
        Source of the redrawn series.

    Returns
    -------
    Dataset
        Over (band, model): ``slope`` (1/s) with ``lower`` and ``upper``, ``change`` over the
        window, ``kendall_tau``, ``p_value``; over (band, model, time): ``error_mean``,
        ``lower_quartile`` and ``upper_quartile`` of ε over the cells. Bands are ``all``, ``low``
        and ``wave``.
    """
    numbers = ("slope", "lower", "upper", "change", "kendall_tau", "p_value", "block_length")
    names = ("error_mean", "lower_quartile", "upper_quartile")
    found = np.full((len(numbers), len(BAND_ERRORS), len(models)), np.nan)
    time = test["time"].values
    series = np.full((len(names), len(BAND_ERRORS), len(models), time.size), np.nan)
    judged = test["judged"].values
    for b, key in enumerate(BAND_ERRORS.values()):
        for m, model in enumerate(models):
            cells = test[f"{model}_{key}"].values[judged]
            cells = cells[np.isfinite(cells).all(axis=1)]
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
        {
            **{n: (("band", "model"), found[i]) for i, n in enumerate(numbers)},
            **{n: (("band", "model", "time"), series[i]) for i, n in enumerate(names)},
        },
        coords={"band": list(BAND_ERRORS), "model": list(models), "time": time},
    )


def joined(test: xr.Dataset, model: str) -> tuple[FloatArray, FloatArray, int]:
    """Forecasts of the windows of a test set joined end to end, and the measurement.

    Parameters
    ----------
    test : Dataset
        A test set.
    model : str
        The model; of an ensemble the mean counts.

    Returns
    -------
    predicted : ndarray, shape (series, time, channel)
        One series a training set that may test all windows; where none may (runs are left out),
        the k-th series takes each window's k-th training set. A series in which a forecast
        diverged is left out.
    measured : ndarray, shape (time, channel)
        The same windows.
    diverged : int
        Series left out.
    """
    judged = test["judged"].values
    mean = test[f"{model}_mean"].values
    count = int(judged.sum(axis=0).min())
    rows = np.argsort(~judged, axis=0, kind="stable")[:count]
    windows = np.arange(judged.shape[1])
    picked = np.stack([mean[row, windows] for row in rows])
    picked = picked.reshape(count, -1, mean.shape[-1])
    whole = np.isfinite(picked).all(axis=(1, 2))
    measured = test["measured"].values.reshape(-1, mean.shape[-1])
    return picked[whole], measured, int(np.count_nonzero(~whole))


def _divergences(
    test: xr.Dataset, model: str, channels: Sequence[str], settings: StudySettings, name: str
) -> tuple[xr.Dataset, xr.Dataset]:
    predicted, measured, diverged = joined(test, model)
    segments = [test.sizes["time"]] * test.sizes["window"]
    numbers = (
        "mean", "lower", "upper", "uncertainty", "of_series", "noise_floor",
        "noise_floor_lower", "noise_floor_upper", "block_length",
    )  # fmt: skip
    table = np.full((len(numbers), len(VARIANTS), len(channels)), np.nan)
    curves = np.full((7, len(channels), 512), np.nan)
    for c, channel in enumerate(channels):
        p, m = predicted[:, :, c], measured[:, c]
        if not len(p) or np.ptp(m) == 0 or np.any(np.ptp(p, axis=1) == 0):
            continue
        for v, (variant, choice) in enumerate(VARIANTS.items()):
            rng = random_stream(settings.study.seed, f"jsd.{name}.{variant}.{channel}")
            with warnings.catch_warnings():
                # Caps of the block length and coarse grids: the table prints the length.
                warnings.simplefilter("ignore", SeakeepWarning)
                found = statistics.jsd_interval(
                    p,
                    m,
                    block_length=choice["block_length"],
                    bandwidth=choice["bandwidth"],
                    segments=None if choice["joins"] else segments,
                    rng=rng,
                    n_series=settings.statistics.n_series,
                )
            table[:, v, c] = [getattr(found, number) for number in numbers]
        curves[:, c] = _densities(p, m, settings, f"densities.{name}.{channel}")
    divergence = xr.Dataset(
        {n: (("variant", "channel"), table[i]) for i, n in enumerate(numbers)},
        coords={"variant": list(VARIANTS), "channel": list(channels)},
    )
    divergence["diverged_series"] = diverged
    keys = ("value", *(f"{side}_{k}" for side in ("measured", "predicted")
                       for k in ("mean", "lower", "upper")))  # fmt: skip
    densities = xr.Dataset(
        {key: (("channel", "grid"), curves[i]) for i, key in enumerate(keys)},
        coords={"channel": list(channels)},
    )
    return divergence, densities


def _densities(p: FloatArray, m: FloatArray, settings: StudySettings, stream: str) -> FloatArray:
    """Grid, and densities with their bands of measurement and forecast (paper's settings)."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SeakeepWarning)  # as above
        grid = statistics.density_grid(p, m, bandwidth="paper")
        rows = [grid]
        for series in (m, p):
            band = statistics.density_interval(
                series,
                block_length="carlstein",
                rng=random_stream(settings.study.seed, stream),
                n_series=settings.statistics.n_series,
                grid=grid,
                bandwidth="paper",
                level=settings.statistics.level,
            )
            rows += [band.mean, band.lower, band.upper]
    return np.stack(rows)


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
    """Whether all windows of a test set lie in runs of regular waves of known frequency.

    Parameters
    ----------
    groups : mapping of str to Dataset
        Of a study: ``runs`` and ``tests/NAME``.
    test : str
        The set.

    Returns
    -------
    bool
    """
    names = [str(run) for run in groups[f"tests/{test}"]["run"].values]
    return bool(np.isfinite(groups["runs"]["wave_frequency"].sel(run=names)).all())


def regular_response(
    groups: Mapping[str, xr.Dataset], test: str, models: Sequence[str]
) -> xr.Dataset:
    """Take the error of a test set in regular waves apart.

    Parameters
    ----------
    groups : mapping of str to Dataset
        Of a study: ``runs``, ``training``, ``tests/NAME``, and ``spectra`` where there are waves.
    test : str
        The set.
    models : sequence of str
        Models.

    Returns
    -------
    Dataset
        Over channel: ``sd_ratio`` (measured SD in training SDs) and ``mean_shift`` (measured mean
        off the training mean, in training SDs), medians over cells. Over (model, channel):
        ``error_offset``, ``error_wave`` and ``error_rest``, root mean squares over cells in
        measured SDs, whose squares add up to that of the NRMSE; ``amplitude_ratio`` (median), and
        ``phase_lead`` (degrees; of the forecast before the measurement, by the mean direction).
        Over model: ``celerity`` and ``celerity_phase``, the lead that one celerity makes for waves
        of another speed, where the alignment has one. Attributes: ``frequency`` (Hz),
        ``phase_speed``, ``height_ratio`` and ``energy_share`` of the training sea, ``surge_shift``
        (m).
    """
    data, runs = groups[f"tests/{test}"], groups["runs"]
    judged, channels = data["judged"].values, list(data["channel"].values)
    frequencies = runs["wave_frequency"].sel(run=data["run"].values.astype(str)).values
    spread, level = data["training_std"].values, data["training_mean"].values
    measured = data["measured"].values
    rows, columns = np.nonzero(judged)
    shift = (measured.mean(axis=1)[columns] - level[rows]) / spread[rows]
    ratio = measured.std(axis=1, ddof=1)[columns] / spread[rows]
    parts = {model: _parts(data, model, frequencies, (rows, columns), measured) for model in models}
    keys = ("error_offset", "error_wave", "error_rest", "amplitude_ratio", "phase_lead")
    out = xr.Dataset(
        {
            "sd_ratio": ("channel", np.median(ratio, axis=0)),
            "mean_shift": ("channel", np.median(shift, axis=0)),
            **{
                key: (("model", "channel"), np.stack([parts[model][k] for model in models]))
                for k, key in enumerate(keys)
            },
        },
        coords={"model": list(models), "channel": channels},
    )
    return _with_waves(out, groups, test, models, float(np.median(frequencies)), (rows, columns))


def _parts(
    data: xr.Dataset,
    model: str,
    frequencies: FloatArray,
    cells: tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]],
    measured: FloatArray,
) -> list[FloatArray]:
    """Errors and responses of a model, each of shape (channel,)."""
    time = data["time"].values
    squares, responses = [], []
    rows, columns = cells
    forecasts = data[f"{model}_mean"].values
    slack = np.isnan(data[f"{model}_nrmse"].values)
    for row, column in zip(rows, columns, strict=True):
        turn = 2 * np.pi * frequencies[column] * time
        basis = np.stack([np.ones_like(time), np.cos(turn), np.sin(turn)], axis=1)
        orthonormal, triangle = np.linalg.qr(basis)
        predicted, truth = forecasts[row, column], measured[column]
        error = predicted - truth
        inside = (orthonormal.T @ error) ** 2
        total = np.sum(error**2, axis=0)
        found = np.stack([inside[0], inside[1:].sum(axis=0), total - inside.sum(axis=0)])
        found /= time.size * truth.var(axis=0, ddof=1)
        # The first of an orthonormal basis of (1, cos, sin) is the mean; amplitudes need (1, …).
        complex_of = [
            np.linalg.solve(triangle, orthonormal.T @ series) for series in (predicted, truth)
        ]
        response = np.divide(*[each[1] - 1j * each[2] for each in complex_of])
        squares.append(np.where(slack[row, column], np.nan, found))
        responses.append(np.where(slack[row, column], np.nan, response))
    known, answer = np.stack(squares), np.stack(responses)
    lost = np.isnan(known).all(axis=(0, 1))
    known[..., lost], answer[..., lost] = 0.0, 1.0
    errors = np.sqrt(np.nanmean(np.maximum(known, 0.0), axis=0))
    direction = np.nanmean(answer / np.abs(answer), axis=0)
    columns_of = [*errors, np.nanmedian(np.abs(answer), axis=0), np.degrees(np.angle(direction))]
    return [np.where(lost, np.nan, each) for each in columns_of]


def _with_waves(
    out: xr.Dataset,
    groups: Mapping[str, xr.Dataset],
    test: str,
    models: Sequence[str],
    frequency: float,
    cells: tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]],
) -> xr.Dataset:
    """Add what linear wave theory and the training sea say about the frequency."""
    data, runs, training = groups[f"tests/{test}"], groups["runs"], groups["training"]
    depth = float(runs["water_depth"].sel(run=str(data["run"].values[0])))
    speed = float(phase_speed(2 * np.pi * frequency, depth)) if np.isfinite(depth) else np.nan
    out.attrs = {"frequency": frequency, "phase_speed": speed, "surge_shift": np.nan}
    out.attrs |= _training_sea(groups, frequency, [str(run) for run in data["run"].values])
    celerity, lead = np.full((2, len(models)), np.nan)
    if "surge" in out["channel"]:
        surge = data.sel(channel="surge")
        rows, columns = cells
        shifts = (
            surge["measured"].values.mean(axis=1)[columns] - surge["training_mean"].values[rows]
        )
        out.attrs["surge_shift"] = float(np.median(shifts))
        for number, model in enumerate(models):
            if f"{model}_celerity" not in training:
                continue
            each = training[f"{model}_celerity"].values[rows]
            celerity[number] = np.median(each)
            turns = frequency * shifts * (1 / speed - 1 / each)
            lead[number] = 360 * np.median(turns)
    out["celerity"] = ("model", celerity)
    out["celerity_phase"] = ("model", lead)
    return out


def _training_sea(
    groups: Mapping[str, xr.Dataset], frequency: float, tested: Sequence[str]
) -> dict[str, float]:
    """Height of the waves, and the training sea's share of energy near a frequency."""
    nothing = {"height_ratio": np.nan, "energy_share": np.nan}
    if "spectra" not in groups:
        return nothing
    spectra, runs = groups["spectra"], groups["runs"]
    learnt = [str(run) for run in runs["run"].values[runs["trains"].values]]
    learnt = [run for run in learnt if f"{run}_recommended_density" in spectra]
    if not learnt:
        return nothing
    heights = spectra["significant_height"]
    shares = []
    for run in learnt:
        f = spectra[f"{run}_recommended_frequency"].values
        density = spectra[f"{run}_recommended_density"].values
        near = np.abs(f - frequency) <= NEAR * frequency
        shares.append(density[near].sum() / density.sum())
    ratio = float(heights.sel(run=list(tested)).mean() / heights.sel(run=learnt).mean())
    return {"height_ratio": ratio, "energy_share": float(np.mean(shares))}
