"""Ensembles of few members."""

from seakeep import BayesianHankelDMDc, Uniform


def few(**changes):
    """Settings of four members that all runs teach, changed as asked for."""
    settings = {
        "encounter_period": 1.6,
        "window": None,
        "state_delays": Uniform("0.2 T", "0.6 T"),
        "input_delays": Uniform("0.5 T", "1.5 T"),
        "ridge": Uniform(1, 10),
        "n_members": 4,
        "delay_rows": "exact",
    }
    return BayesianHankelDMDc(**settings | changes)
