"""Raw logger samples in service: the campaign's own chain on a window that moves on.

Offline filters look both ways, so a sample is only as good as what follows it. In service the
same steps run on the last part of the record, and a sample is handed out once `delay` seconds
after it are there: it differs from the offline one by what the ends of the window still do to it.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from seakeep.arrays import ArrayLike, FloatArray, as_real
from seakeep.campaign.pipeline import Logger, Run, cleaned, derived, mapped, resampled
from seakeep.campaign.readers import find_column, time_column, time_unit_of
from seakeep.conventions import conversion
from seakeep.errors import RequestError, did_you_mean
from seakeep.files import load_sealed, write_sealed
from seakeep.signals.time_axis import DAY

STATE = "state of a live chain"
"""Kind of the files of :meth:`LiveChain.save`."""


class LiveChain:
    """Takes raw samples of loggers and gives model samples; made by ``campaign.live_chain()``.

    Parameters
    ----------
    run : Run
        A run whose files have the columns that the loggers send, clocks known and not yet mapped.
    dt : float
        Time step of the model samples, s.
    delay : float
        Time that must have passed after a model sample before it is handed out, s.
    window : float
        Length of the record that the chain works on, s.
    every : int
        Model samples that are handed out together, at least; the chain runs once for them.
    """

    def __init__(self, run: Run, dt: float, delay: float, window: float, every: int) -> None:
        self._run, self.dt = run, dt
        self.delay, self.window, self.every = delay, window, every
        self._time = {key: _time_column(logger) for key, logger in run.loggers.items()}
        self._rows: dict[str, dict[str, FloatArray]] = {
            key: {name: np.empty(0) for name in logger.columns.values}
            for key, logger in run.loggers.items()
        }
        self._origin: float | None = None
        self._given = 0

    def push(self, samples: Mapping[str, Mapping[str, ArrayLike]]) -> xr.Dataset:
        """Take raw samples, and give the model samples that are ready.

        Parameters
        ----------
        samples : mapping of str to mapping of str to array_like
            By logger (``""`` where a run is one file) its new rows: numbers by column, in the units
            of the template's file, with their instants on the logger's own clock. Loggers need not
            send together.

        Returns
        -------
        Dataset
            All channels of the campaign over ``time``, the instants on the reference's clock, in
            steps of :attr:`dt`; often none. NaN in gaps that the campaign does not bridge: what
            preparation refuses is masked in service.

        Raises
        ------
        RequestError
            If a logger or a column is unknown, lengths differ, instants do not increase, or a
            logger is silent for longer than the window.
        DataError
            If the chain cannot use the samples. Nothing was taken then, as with a RequestError.
        """
        rows = dict(self._rows)
        for key, table in samples.items():
            more = self._checked(key, table)
            rows[key] = {name: np.concatenate([x, more[name]]) for name, x in rows[key].items()}
        # On the reference's clock.
        instants = {
            key: self._run.clocks[key].reference(rows[key][name] * factor)
            for key, (name, factor) in self._time.items()
        }
        # Nothing can be made without a silent logger, and the others' rows pile up.
        start = min((each[0] for each in instants.values() if each.size), default=0.0)
        latest = {key: each[-1] if each.size else start for key, each in instants.items()}
        last = min(latest, key=latest.__getitem__)
        if (silent := max(latest.values()) - latest[last]) > self.window:
            raise RequestError(
                f"'{last}' has sent nothing for {silent:g} s, and samples are made of all loggers. "
                "Send rows of it up to the others' instants, NaN in its columns."
            )
        origin, given, ready = self._origin, self._given, 0
        if all(each.size for each in instants.values()):
            if origin is None:
                # As offline: multiples of the step from the first instant of the reference.
                firsts = [each[0] for each in instants.values()]
                origin = firsts[0]
                given = math.ceil((max(firsts) - origin + self.delay) / self.dt - 1e-6)
            ready = math.floor((latest[last] - self.delay - origin) / self.dt + 1e-9) + 1
        if origin is None or ready - given < self.every:
            empty = dict.fromkeys(self._run.settings.channel_names, ("time", np.empty(0)))
            out = xr.Dataset(empty, {"time": np.empty(0)})
        else:
            out = self._prepared(rows, origin, given, ready)
            given = ready
            # Rows that have left the window are forgotten.
            oldest = origin + ready * self.dt + self.delay - self.window
            for key, table in rows.items():
                kept = slice(np.searchsorted(instants[key], oldest), None)
                rows[key] = {name: values[kept] for name, values in table.items()}
        self._rows, self._origin, self._given = rows, origin, given
        return out

    def save(self, path: str | Path) -> Path:
        """Write the rows that the chain still needs, for :meth:`resume` in another process.

        Parameters
        ----------
        path : str or Path
            File; an earlier state of a chain there is replaced.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        RequestError
            If the file cannot be written, or another one is there.
        """
        rows = [values for table in self._rows.values() for values in table.values()]
        states = [self._columns(), self._origin, self._given, [len(values) for values in rows]]
        kept = xr.Dataset({"values": ("number", np.concatenate(rows))})
        return write_sealed(kept.assign_attrs(kept=json.dumps(states)), path, STATE)

    def resume(self, path: str | Path) -> None:
        """Go on from a state that :meth:`save` wrote, as if the process had never stopped.

        Parameters
        ----------
        path : str or Path
            File of a chain that was made in the same way.

        Raises
        ------
        RequestError
            If the loggers, their columns or the step of the model are others.
        DataError
            If the file is damaged, or another one.
        """
        dataset = load_sealed(path, STATE)
        columns, origin, given, sizes = json.loads(dataset.attrs["kept"])
        if columns != self._columns():
            raise RequestError(
                f"{path} is the state of a chain with other loggers, columns or steps. Make the "
                "chain as the one that was saved, or start without its state."
            )
        rows = iter(np.split(dataset["values"].values, np.cumsum(sizes)))
        self._rows = {
            key: {name: next(rows) for name in table} for key, table in self._rows.items()
        }
        self._origin, self._given = origin, given

    def _columns(self) -> list[object]:
        return [self.dt, {key: list(table) for key, table in self._rows.items()}]

    def _checked(self, key: str, table: Mapping[str, ArrayLike]) -> dict[str, FloatArray]:
        if key not in self._rows:
            raise RequestError(
                f"there is no logger '{key}'.{did_you_mean(key, self._rows)} Loggers: "
                f"{', '.join(self._rows)}."
            )
        logger = self._run.loggers[key]
        arrays = {
            find_column(logger.path, logger.columns, name): as_real(values, name)
            for name, values in table.items()
        }
        missing = [name for name in self._rows[key] if name not in arrays]
        sizes = {each.shape for each in arrays.values()}
        if missing or len(sizes) != 1 or len(next(iter(sizes))) != 1:
            raise RequestError(
                f"'{key}' sends {', '.join(arrays) or 'nothing'} of shapes "
                f"{', '.join(map(str, sorted(sizes)))}; all of {', '.join(self._rows[key])} are "
                "needed, a number per row each. Send NaN for a value that was lost."
            )
        name, factor = self._time[key]
        last = self._rows[key][name][-1:]
        times = np.concatenate([last, arrays[name]]) * factor
        steps = np.diff(times)
        # Seconds of day count on after midnight, where no more than a window was lost there.
        past = (steps < 0) & (steps % DAY <= self.window)
        counted = times - DAY * np.cumsum([0.0, *np.where(past, steps // DAY, 0.0)])
        if not np.all(np.diff(counted) > 0) or not np.all(np.isfinite(times)):
            raise RequestError(
                f"the instants of '{key}' do not increase: "
                f"{', '.join(f'{each:g}' for each in times[:4])} … s. Send each row once, in order."
            )
        if past.any():
            arrays[name] = counted[last.size :] / factor
        return arrays

    def _prepared(
        self, rows: Mapping[str, dict[str, FloatArray]], origin: float, first: int, stop: int
    ) -> xr.Dataset:
        """Model samples of these numbers, by the chain over the whole window."""
        dt = self.dt
        loggers = {
            key: replace(logger, columns=replace(logger.columns, values=rows[key]))
            for key, logger in self._run.loggers.items()
        }
        run = derived(cleaned(mapped(replace(self._run, loggers=loggers))))
        ends = [each["time"].values[[0, -1]] for each in run.groups.values()]
        low = math.ceil((max(each[0] for each in ends) - origin) / dt - 1e-9)
        high = math.floor((min(each[1] for each in ends) - origin) / dt + 1e-9)
        data = resampled(run, dt, origin + dt * np.arange(low, high + 1)).data
        ready = data[[*run.settings.channel_names]].isel(
            time=slice(max(first - low, 0), stop - low)
        )
        return ready.reset_coords(drop=True)


def _time_column(logger: Logger) -> tuple[str, float]:
    """Name of a logger's time column, and its unit in seconds."""
    columns, stated = logger.columns, logger.options
    name = time_column(columns, stated.time)
    if name is None:
        raise RequestError(
            f"{logger.path} has no time column, and in service samples need their instants. Have "
            "the logger send them."
        )
    return name, conversion(time_unit_of(columns, name, stated.time_unit), "s")
