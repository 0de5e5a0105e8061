"""What would take more memory than there is, is refused before it does."""

import numpy as np
import pytest

from seakeep import HankelDMDc, read_campaign, signals
from seakeep.errors import RequestError, SeakeepWarning
from seakeep.models.training import gather
from seakeep.study.settings import StudySettings
from seakeep.toml import validated

X = np.sin(np.arange(0, 60, 0.05))
STUDY = {"study": {"campaign": "c.toml"}, "statistics": {"n_series": 10**8}}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: signals.low_pass(X, 0.05, 1.0, 1.0 + 1e-9), r"passband|stopband.* taps; at most"),
        (lambda: signals.lowpass_taps(500.0, 10.0, 10.0001), "Move stopband away from passband"),
        (lambda: signals.lowpass_taps(20.0, 1.0, 2.0, 1e9), "taps; at most 100000 are allowed"),
        (
            lambda: signals.resample(
                X, np.arange(1200), np.arange(10, 900, 1.5), passband=1 - 1e-9
            ),
            "taps; at most .* or lower passband",
        ),
        (
            lambda: signals.resample(X, np.arange(1200), np.arange(9, 90, 1.5), passband=2),
            "a part of the Nyquist frequency, must lie between 0 and 1",
        ),
        (lambda: signals.integrate(X, 0.05, (1e-9, 1.0)), r"lower edge .*1e-09 Hz.* period of"),
        (lambda: signals.complementary_filter(X, X, 0.05, 1e-9), r"the crossover \(1e-09 Hz\)"),
        (lambda: validated(StudySettings, STUDY, "s", "study"), "n_series: received 100000000"),
    ],
)
def test_sizes_are_judged_first(call, message):
    with pytest.raises(RequestError, match=message):
        call()


@pytest.mark.parametrize("key", ["sampling_rate", "steps_per_period"])
def test_a_rate_that_fills_the_memory_is_refused_by_its_key(edited, key):
    path = edited(("sampling_rate = 10", f"{key} = 10000000"))
    message = rf"preparation\.{key} = 1e\+07: .* samples of run 'first' .* MiB; at most 1907"
    with pytest.raises(RequestError, match=message):
        read_campaign(path).prepare(["first"])


def test_delays_that_fill_the_memory_are_refused_and_long_ones_told(make_dataset):
    noise = np.random.default_rng(0).standard_normal((2, 4000))
    run = make_dataset(0.1 * np.arange(4000.0), heave=noise[0], eta=noise[1])
    said = r"state_delays = 30000 of 1 states: a matrix of 30001 rows takes .* MiB; at most 1907"
    with pytest.raises(RequestError, match=said):
        HankelDMDc(30_000, 2, 1.0).fit(run, ["heave"], ["eta"])
    long = HankelDMDc(3000, 2, 1.0)
    with pytest.warns(SeakeepWarning, match=r"rows takes 68\.7 MiB, which takes long\. Take fewer"):
        gather({"run": run}, ["heave"], ["eta"], None, long)
