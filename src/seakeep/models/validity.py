"""Waves that a model was trained in, and how the waves of a forecast compare with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from seakeep.arrays import BoolArray, FloatArray
from seakeep.core.wave_bands import PER_OCTAVE, band_edges, band_energy
from seakeep.models import labelled, store
from seakeep.models.interface import Model

__all__ = ["Coverage", "Waves", "compare_waves"]

TRAINED = 0.01
"""Part of the training energy from which a band, or a neighbour of it, counts as trained: the
leakage of a taper stays below it, and the tail of a sea above twice its peak frequency too."""


@dataclass(frozen=True)
class Waves:
    """An input of a forecast beside that of the training.

    Parameters
    ----------
    channel : str
        The input.
    period : float
        Period of the band that holds most of its energy, s.
    trained : (float, float)
        Shortest and longest period of the bands that were trained, s.
    outside : float
        Fraction of its energy in bands that were not trained, 0 to 1.
    is_gap : bool
        Whether `period` lies between trained periods without being one of them.
    """

    channel: str
    period: float
    trained: tuple[float, float]
    outside: float
    is_gap: bool

    @property
    def is_untrained(self) -> bool:
        """Whether most of the energy lies at periods that were not trained."""
        return self.outside > 0.5

    @property
    def text(self) -> str:
        """A sentence; empty where the waves are those of the training."""
        if not self.is_untrained:
            return ""
        low, high = self.trained
        where = "in a gap of" if self.is_gap else "outside"
        return (
            f"{self.channel}: the dominant period of {self.period:.3g} s lies {where} the periods "
            f"that trained the model ({low:.3g} to {high:.3g} s); {100 * self.outside:.0f} % of "
            "the energy is at periods it has not seen"
        )


@dataclass(frozen=True, eq=False)
class Coverage:
    """Energy of the training input in bands of frequency.

    Parameters
    ----------
    channels : tuple of str
        Inputs.
    first : int
        Number of the first band.
    shares : ndarray, shape (channel, band)
        Fraction of the energy in each band.
    """

    channels: tuple[str, ...]
    first: int
    shares: FloatArray

    @classmethod
    def of(cls, channels: Sequence[str], series: Sequence[FloatArray], dt: float) -> Coverage:
        """Coverage of the windows of several runs, each (time, channel)."""
        longest = max(len(each) for each in series)
        first = int(np.floor(PER_OCTAVE * np.log2(1.0 / (longest * dt))))
        count = int(np.floor(PER_OCTAVE * np.log2(0.5 / dt))) + 1 - first
        energy = sum(
            (band_energy(each, dt, first, count) for each in series),
            np.zeros((len(channels), count)),
        )
        return cls(tuple(channels), first, _shares(energy))

    def is_trained(self, frequency: FloatArray) -> BoolArray:
        """Whether frequencies (Hz) lie in bands that were trained, or beside one.

        Returns
        -------
        ndarray of bool, shape (channel, frequency)
        """
        edges = band_edges(self.first, self.shares.shape[1])
        band = np.searchsorted(edges, frequency, side="right") - 1
        inside = (band >= 0) & (band < self.shares.shape[1])
        known = _with_neighbours(self.shares >= TRAINED)
        result: BoolArray = inside & known[:, np.clip(band, 0, self.shares.shape[1] - 1)]
        return result

    def compare(self, inputs: FloatArray, dt: float) -> list[Waves]:
        """Compare the inputs (time, channel) of a forecast with those of training."""
        found = _shares(band_energy(inputs, dt, self.first, self.shares.shape[1]))
        edges = band_edges(self.first, self.shares.shape[1])
        periods = 1.0 / np.sqrt(edges[:-1] * edges[1:])
        out = []
        for column, channel in enumerate(self.channels):
            is_trained = self.shares[column] >= TRAINED
            if not is_trained.any() or not found[column].any():
                continue  # a constant has no period
            known = _with_neighbours(is_trained)
            peak = int(np.argmax(found[column]))
            inside = np.flatnonzero(is_trained)
            out.append(
                Waves(
                    channel=channel,
                    period=float(periods[peak]),
                    trained=(float(periods[inside[-1]]), float(periods[inside[0]])),
                    outside=float(found[column][~known].sum()),
                    is_gap=bool(inside[0] < peak < inside[-1] and not known[peak]),
                )
            )
        return out

    def to_variables(self) -> dict[str, Any]:
        """Variables of a file."""
        label = {"long_name": "part of the training energy", "units": "1", "first": self.first}
        return {"wave_shares": (("channel", "band"), self.shares, label)}

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset) -> Coverage:
        """Rebuild from :meth:`to_variables`."""
        channels = tuple(label.name for label in store.labels(dataset, "inputs"))
        shares = store.numbers(dataset, "wave_shares", (len(channels), None))
        return cls(channels, int(dataset["wave_shares"].attrs["first"]), shares)


def compare_waves(model: Model, run: xr.Dataset, start: float, steps: int) -> list[Waves]:
    """Compare the waves that drive a forecast with those that trained the model.

    Parameters
    ----------
    model : Model
        A model that keeps its ``coverage``; of another one nothing is known.
    run : Dataset
        The run that is forecast.
    start : float
        Instant of the last measured state, s.
    steps : int
        Instants forecast.

    Returns
    -------
    list of Waves
        One per input that moves; ``text`` is a sentence where the waves are others.
    """
    coverage: Coverage | None = getattr(model, "coverage", None)
    if coverage is None or not model.inputs:
        return []
    name = labelled.run_name(run, "the run")
    time = np.asarray(run["time"].values, dtype=float)
    at = labelled.nearest_sample(time, labelled.as_instant(start, "start"), name)
    first = max(at - model.signature.input_delays, 0)
    values = labelled.channel_matrix(run, model.inputs, name, slice(first, at + steps))
    if len(values) < 2 or not np.all(np.isfinite(values)):
        return []
    return coverage.compare(values, model.dt)


def _with_neighbours(is_trained: BoolArray) -> BoolArray:
    """Bands (…, band) and those beside them: the leakage of a taper reaches there."""
    known = is_trained.copy()
    known[..., 1:] |= is_trained[..., :-1]
    known[..., :-1] |= is_trained[..., 1:]
    return known


def _shares(energy: FloatArray) -> FloatArray:
    total = energy.sum(axis=1, keepdims=True)
    out: FloatArray = np.divide(energy, total, out=np.zeros_like(energy), where=total > 0)
    return out
