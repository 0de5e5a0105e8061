"""Rows from which an exported model starts."""

import numpy as np

from seakeep import HankelDMDc
from seakeep.hosts import start_rows


def test_rows_end_at_the_start_and_inputs_where_the_first_step_takes_over(make_run, channels):
    run = make_run(samples=300)
    model = HankelDMDc(3, 8, 1.0, lead=4).fit(run, **channels)
    x, u = start_rows(model, run, run.time.values[50])
    np.testing.assert_array_equal(x, run[model.states].to_array().values.T[47:51])
    np.testing.assert_array_equal(u, run[model.inputs].to_array().values.T[42:54])
