"""The paper's data matrices, written out as an oracle."""

import numpy as np

from seakeep.core import embed


def snapshot_matrices(states, inputs, window, state_delays, input_delays, all_rows):
    """Extended states over extended inputs, and the next states: all of them or the newest."""
    first, count = window.first_column, window.columns
    groups = ((states, state_delays), (inputs, input_delays))
    regressors = np.concatenate([embed(x, delays, first, count) for x, delays in groups])
    return regressors, embed(states, state_delays if all_rows else 0, first + 1, count)
