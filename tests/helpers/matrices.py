"""Regressions of delayed series, with the paper's data matrices written out as an oracle."""

from dataclasses import dataclass

import numpy as np

from seakeep.core import embed, identify
from seakeep.core.embedding import Delayed


@dataclass(frozen=True)
class Problem:
    """Runs with groups of channels: states, delayed and direct inputs, down to none."""

    states: list
    inputs: list
    direct: list
    windows: list
    s: int
    z: int

    def matrices(self, all_rows=True):
        """Plain Hankel matrices: regressors, and all rows of the next states or the newest."""
        regressors, targets = [], []
        for x, u, d, window in self.runs():
            first, count = window.first_column, window.columns
            groups = (embed(x, self.s, first, count), embed(u, self.z, first, count))
            regressors.append(np.concatenate([*groups, d[first : window.last].T]))
            targets.append(embed(x, self.s if all_rows else 0, first + 1, count))
        return np.concatenate(regressors, axis=1), np.concatenate(targets, axis=1)

    @property
    def trace(self):
        """Sum of the squares of the regressors."""
        return np.sum(self.matrices()[0] ** 2)

    def runs(self):
        return zip(self.states, self.inputs, self.direct, self.windows, strict=True)

    @property
    def delayed(self):
        """What the fast paths take."""
        groups = (self.states, self.s), (self.inputs, self.z), (self.direct, 0)
        return Delayed(self.states, groups, self.windows)

    def solved(self, ridge, **options):
        settings = {"state_delays": self.s, "input_delays": self.z, "direct": self.direct}
        return identify(self.states, self.inputs, self.windows, ridge=ridge, **settings | options)
