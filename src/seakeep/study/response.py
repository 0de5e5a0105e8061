"""Where the error in regular waves comes from: offset, response at the wave's frequency, the rest.

In a regular wave a linear model has two ways to be right or wrong, amplitude and phase at one
frequency; what its mean does is another matter, since steady drift is quadratic in the waves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.waves import phase_speed

__all__ = ["is_regular", "regular_response", "wave_frequency"]

FloatArray = npt.NDArray[np.float64]

NEAR = 0.1
"""Energy within this part of a frequency counts as energy at it."""


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
