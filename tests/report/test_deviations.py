"""The table of deviations says in words what is in effect."""

import pytest

import seakeep
from seakeep.report.deviations import alignment_words, prior_words


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({}, "one celerity, estimated from the two probes in each training window, to the measured "
             "surge"),
        ({"celerity": 2.8, "surge": "none"}, "one celerity, 2.8 m/s as stated, to the place at "
                                             "rest"),
        ({"mode": "dispersion", "surge": "predicted"}, "linear dispersion, frequency by frequency, "
                                                       "to the surge that the model itself "
                                                       "predicts"),
        ({"mode": "dispersion", "highest_frequency": 1.5, "offset": -2.0, "channels": ["eta_fwd"]},
         "linear dispersion, frequency by frequency up to 1.5 Hz, to the measured surge, and by -2 "
         "m in all runs; elevations: eta_fwd"),
    ],
)  # fmt: skip
def test_an_alignment_is_said_in_words(keys, words):
    printed = str(seakeep.ProbeAlignment(**keys))
    assert alignment_words(printed) == words
    assert "=" not in alignment_words(printed)


def test_priors_are_said_in_words():
    assert prior_words(str(seakeep.Uniform(50, 150))) == "uniform from 50 to 150"
    assert prior_words(str(seakeep.LogUniform(0.05, 0.5))) == "log-uniform from 0.05 to 0.5"
    assert prior_words("100.0") == "100"
