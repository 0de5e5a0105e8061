"""Rows from which an exported model starts."""

import numpy as np
import pytest

from seakeep import DataError, HankelDMDc, RequestError
from seakeep.hosts import start_rows


def test_rows_end_at_the_start_and_inputs_where_the_first_step_takes_over(make_run, channels):
    run = make_run(samples=300)
    model = HankelDMDc(3, 8, 1.0, lead=4).fit(run, **channels)
    x, u = start_rows(model, run, run.time.values[50])
    np.testing.assert_array_equal(x, run[model.states].to_array().values.T[47:51])
    np.testing.assert_array_equal(u, run[model.inputs].to_array().values.T[42:54])


def test_what_a_run_does_not_hold_is_refused(make_run, channels):
    run = make_run(samples=300)
    model = HankelDMDc(3, 8, 1.0, lead=4).fit(run, **channels)
    for sample in (7, 297):
        with pytest.raises(RequestError, match=r"8 before it and 3 after it\. Choose an instant"):
            start_rows(model, run, run.time.values[sample])
    run.eta_cog[45] = np.nan
    with pytest.raises(DataError, match=r"'eta_cog' of .* has 1 missing"):
        start_rows(model, run, run.time.values[50])
