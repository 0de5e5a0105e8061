"""Time histories: figures, and data for the interactive plot, packed small."""

import base64
import json
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from seakeep.arrays import Json
from seakeep.conventions import displayed, is_elevation
from seakeep.files import write_text
from seakeep.models.labelled import nearest_sample
from seakeep.report.figures.histories import history_figure, shown_cells
from seakeep.report.page import Section, drawing, section
from seakeep.report.style import judged_models, line_of, model_words, shown_unit
from seakeep.report.tables import entries, row
from seakeep.study import StudyResult
from seakeep.study.judge import window_spans

MISSING = 65535


def histories(result: StudyResult) -> Section:
    """Return figures of the cells that are shown."""
    calibrated = ", and that band calibrated (thin lines)" * result.is_calibrated
    level = f"{100 * result.level:g}"
    bands = f"; of an ensemble its mean with its {level} % band{calibrated}"
    words = {"bands": bands * bool(result.ensembles)}
    figures = []
    for cell in shown_cells(result):
        test, _, window = cell
        words |= {"name": f"history_{test}_{window:03d}", "test": result.label_of(test)}
        figures.append(drawing("history", history_figure, result, *cell, **words))
    return section("histories", *figures)


def pack(values: npt.ArrayLike) -> Json:
    """Pack numbers as 16-bit integers between their bounds, base64; NaN has a code of its own.

    Examples
    --------
    >>> packed = pack([0.0, 1.0, float("nan")])
    >>> packed["low"], packed["high"], packed["data"]
    (0.0, 1.0, 'AAD+////')
    """
    x = np.asarray(values, dtype=float)
    known = np.isfinite(x)
    low, high = (float(x[known].min()), float(x[known].max())) if known.any() else (0.0, 1.0)
    step = (high - low) / (MISSING - 1) or 1.0
    codes = np.where(known, np.rint((x - low) / step), MISSING).astype("<u2")
    return {"low": low, "high": high, "data": base64.b64encode(codes.tobytes()).decode()}


def explorer(result: StudyResult) -> Section:
    """Return the interactive plot: what there is to choose from, and the cell that it opens with.

    All other cells lie in files of :func:`write_histories`, which the page loads when they are
    chosen.
    """
    cells = shown_cells(result)
    if not cells:
        return section("explore")
    test, training, window = cells[0]
    channels, waves = (
        [
            {"name": name, "label": label, "unit": shown_unit(displayed(unit)[1])}
            for name, label, unit in (
                row(at, "name", "long_name", "units")
                for at in entries(result.groups["channels"].sel(name=group), "name")
            )
        ]
        for group in (result.channels, _elevations(result))
    )
    models = [
        {
            "name": model,
            "label": words,
            "mean": f"{words} mean" if model in result.ensembles else words,
            "colour": line["color"],
            "dash": list(line["linestyle"][1]),
        }
        for model in judged_models(result)
        for line, words in [(line_of(result, model), model_words(model))]
    ]
    tests = [
        {
            "name": name,
            "label": result.label_of(name),
            "steps": data.sizes["time"],
            "training": data["training"].values.tolist(),
            "windows": [f"{run} from {start:.1f} s" for run, start, _ in window_spans(data)],
            "judged": data["judged"].values.astype(int).tolist(),
        }
        for name, data in result.tests.items()
    ]
    data = {
        "step": result.dt,
        "channels": channels,
        "waves": waves,
        "models": models,
        "tests": tests,
        "open": {
            "test": list(result.tests).index(test),
            "training": training,
            "window": window,
            "channel": result.channels.index("heave") if "heave" in result.channels else 0,
            "cell": _cells(result, test)(training, window),
        },
    }
    return section("explore", histories=data)


def write_histories(result: StudyResult) -> None:
    """Write every cell for the interactive plot, a script per test set and training set."""
    folder = result.folder / "histories"
    folder.mkdir(exist_ok=True)
    for test, data in result.tests.items():
        cell = _cells(result, test)
        for training, judged in enumerate(data["judged"].values):
            cells = {window: cell(training, window) for window in np.flatnonzero(judged).tolist()}
            text = json.dumps(cells, separators=(",", ":"))
            name = f"{test}-{training}"
            write_text(folder / f"{name}.js", f'seakeepCells["{name}"]={text};\n')


def _elevations(result: StudyResult) -> list[str]:
    """Inputs that are wave elevations."""
    return list(filter(is_elevation, result.groups["channels"]["name"].values))


def _cells(result: StudyResult, test: str) -> Callable[[int, int], Json]:
    """Packs a cell of a test set, by training set and window: waves, motions, bands, errors."""
    data, elevations = result.tests[test], _elevations(result)
    units = result.groups["channels"]["units"].sel(name=result.channels).values
    factors = [displayed(unit)[0] for unit in units]
    series = {}
    for model in judged_models(result):
        one, keys = data.sel(model=model, measure="nrmse"), ["mean"]
        if model in result.ensembles:
            one, keys = one.sel(ensemble=model), ["mean", "lower", "upper"]
        series[model] = one["error"].values, {key: one[key].values for key in keys}

    def packed(values: npt.NDArray[Any]) -> list[Json]:
        """Values (time, channel) in the units that are shown, packed channel by channel."""
        return [pack(factor * values[:, k]) for k, factor in enumerate(factors)]

    def cell(training: int, window: int) -> Json:
        models = {}
        for model, (errors, parts) in series.items():
            rounded = errors[training, window].round(3).tolist()
            nrmse = [e if np.isfinite(e) else None for e in rounded]
            own = {key: packed(values[training, window]) for key, values in parts.items()}
            models[model] = {**own, "nrmse": nrmse}
        name, start = (data[key].values[window] for key in ("run", "start"))
        run = result.prepared[name]
        first = nearest_sample(run["time"].values, start, name) + 1
        part = slice(first, first + data.sizes["time"])
        return {
            "measured": packed(data["measured"].values[window]),
            "waves": [pack(run[each].values[part]) for each in elevations],
            "models": models,
        }

    return cell
