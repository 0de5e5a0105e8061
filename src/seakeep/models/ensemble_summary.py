"""What an ensemble says of itself."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from seakeep.errors import SeakeepWarning
from seakeep.models.forecasting import alignment_line, counted, with_units
from seakeep.signals.time_axis import span_text

if TYPE_CHECKING:
    from seakeep.models.fitted_ensemble import HankelEnsemble

__all__ = ["summary", "warn_of_unstable"]

FloatArray = npt.NDArray[np.float64]

SAMPLING = {"monte_carlo": "Monte Carlo", "sobol": "Sobol"}
TRAIN_ON = {
    "all": "together",
    "runs": "one of them a member, drawn",
    "windows": "a window of one of them a member, drawn",
}


def summary(ensemble: HankelEnsemble) -> str:
    """Text of ``HankelEnsemble.summary``."""
    origin, settings, draws = ensemble.origin, ensemble.settings, ensemble.members
    count = ensemble.n_members
    refused = sum(draw.redrawn for draw in draws)
    scale = ", a snapshot pair" if settings.ridge_scale == "per_snapshot" else ""
    lines = [
        f"Ensemble of {counted(count, 'Hankel DMD model')} with control: "
        f"{counted(len(ensemble.states), 'state')}, {counted(len(ensemble.inputs), 'input')}, "
        f"dt {ensemble.dt:g} s",
        f"  states        {', '.join(with_units(ensemble.state_labels))}",
        f"  inputs        {', '.join(with_units(ensemble.input_labels)) or 'none (autonomous)'}",
        f"  draws         {SAMPLING[origin['sampling']]}, seed {origin['seed']}; "
        f"{refused or 'none'} infeasible and drawn again",
        f"  window        {_window(ensemble)}",
        f"  state delay   {_periods([d.state_delay for d in draws])} "
        f"({_samples([d.state_delays for d in draws])})",
        f"  input delay   {_periods([d.input_delay for d in draws])} "
        f"({_samples([d.input_delays for d in draws])})",
        f"  ridge         {_range([d.ridge for d in draws], '.4g')}{scale}; delay rows "
        f"{'exact' if settings.delay_rows == 'exact' else 'regressed'}",
        f"  history       {ensemble.history_samples} samples up to the start of a forecast",
        *alignment_line(ensemble.alignment),
        f"  training      {counted(len(ensemble.arrays.names), 'run')}"
        + (f", {TRAIN_ON[origin['train_on']]}" if len(ensemble.arrays.names) > 1 else ""),
    ]
    lines += [
        f"    {name}: {span_text(*span, ensemble.dt)}"
        for name, span in ensemble.training_spans.items()
    ]
    if (calibration := ensemble.calibration) is not None:
        found, count_of = calibration.found, sum(calibration.windows.values())
        relative = found.margin / ensemble.state_spread
        lines.append(
            f"  band          calibrated for {found.level:g} on {counted(count_of, 'window')} of "
            f"{calibration.steps} steps: wider by {_range(relative, '.2g')} training SD either way"
        )
    radii = ensemble.spectral_radii()
    unstable = int(np.count_nonzero(radii >= 1.0))
    verdict = (
        f"{unstable} of {count} UNSTABLE: their long forecasts diverge" if unstable else "stable"
    )
    lines.append(
        f"  stability     spectral radius {_range(radii, '.6f')}, median {np.median(radii):.6f} "
        f"({verdict})"
    )
    return "\n".join(lines)


def warn_of_unstable(radii: FloatArray) -> None:
    """Warn of members whose spectral radius is one or more, with what to do."""
    if unstable := int(np.count_nonzero(radii >= 1.0)):
        warnings.warn(
            f"{unstable} of {counted(radii.size, 'member')} have a spectral radius of one or more "
            f"(up to {radii.max():.6f}): a free run of theirs grows, and once it is lost it is "
            "left out of mean and band. Raise the ridge, train on more data, use shorter state "
            "delays, or look for transients at the ends of the training runs.",
            SeakeepWarning,
            stacklevel=4,  # past spectral_radii, to who asked for them
        )


def _window(ensemble: HankelEnsemble) -> str:
    windows = [draw.window for draw in ensemble.members if draw.window is not None]
    if not windows:
        return "all of a run"
    periods = _periods([draw.train_length for draw in ensemble.members])
    return f"{periods} ({_samples(windows)})"


def _range(values: Sequence[float] | FloatArray, form: str) -> str:
    low, high = format(min(values), form), format(max(values), form)
    return low if low == high else f"{low} to {high}"


def _periods(values: Sequence[float]) -> str:
    return _of(_range(values, ".4g"), "encounter period")


def _samples(values: Sequence[int]) -> str:
    return _of(_range(values, "d"), "sample")


def _of(count: str, unit: str) -> str:
    return f"{count} {unit}" if count == "1" else f"{count} {unit}s"
