"""Waves carried to the vessel by predicted surge; two test sets, one regular."""

from math import tau

import numpy as np
import pytest
from near import assert_near
from seas import Sea
from small_tank import write_csv
from tutorial_study import assert_cells_are_what_the_models_say, studied, study_of

from seakeep.study.plan import make_plan

# The runs are short, for speed: their windows hold two periods of the slow surge of 17 s.
pytestmark = pytest.mark.filterwarnings("ignore:the training windows:seakeep.SeakeepWarning")

RATE, DEPTH, PROBE = 10.0, 3.6, -1.5

CAMPAIGN = f"""
[campaign]
encounter_period = 1.6
[rig]
water_depth = {DEPTH}
positions = {{ eta_fwd = {PROBE} }}
[channels.eta_fwd]
column = "eta"
[channels.surge]
column = "x"
[channels.heave]
column = "z"
[runs.sea]
file = "sea.csv"
train = [0, 60]
test = [60, 110]
[runs.wave]
file = "wave.csv"
waves = "regular"
role = "test"
[preparation]
sampling_rate = 10
[model]
states = ["surge", "heave"]
inputs = ["eta_fwd"]
"""

STUDY = """
[study]
campaign = "campaign.toml"
[training]
windows = 1
[models.deterministic]
state_delays = 6
input_delays = 20
ridge = 1e-2
alignment = { mode = "dispersion", surge = "predicted" }
delay_rows = "exact"
lead = "0.75 T"
[models.bayesian]
kind = "bayesian_hankel_dmdc"
n_members = 3
window = { uniform = ["15 T", "20 T"] }
state_delays = { uniform = ["0.3 T", "0.6 T"] }
input_delays = { uniform = ["1 T", "2 T"] }
ridge = 1e-2
alignment = { mode = "dispersion", surge = "predicted" }
delay_rows = "exact"
lead = "0.75 T"
[tests.later]
runs = ["sea"]
windows = 2
length = 8
[tests.regular]
waves = "regular"
windows = 3
length = 5
startup = 12
[statistics]
n_series = 4
[output]
eigenvalues = false
"""


def write_run(path, seed, seconds, frequencies, grows=0.0):
    """A vessel that surges slowly and heaves with the wave where it is."""
    rng = np.random.default_rng(seed)
    time, f = np.arange(round(seconds * RATE) + 1) / RATE, np.asarray(frequencies)
    sea = Sea(f, 0.02 * np.ones(f.size), rng.uniform(0, tau, f.size), DEPTH)
    surge = 0.4 * np.sin(tau * time / 17)
    envelope = np.clip(time / grows, 0, 1) if grows else 1.0
    noise = 1e-4 * rng.standard_normal((2, time.size))
    heave = 0.8 * envelope * sea.at(time, surge) + noise[1]
    eta = envelope * sea.at(time, PROBE)
    write_csv(path, {"t [s]": time, "eta [m]": eta, "x [m]": surge + noise[0], "z [m]": heave})


def test_cells_and_statistics_of_both_sets_are_what_the_models_say(tmp_path):
    write_run(tmp_path / "sea.csv", 2, 110, np.random.default_rng(2).uniform(0.4, 0.9, 12))
    write_run(tmp_path / "wave.csv", 3, 40, [0.6], grows=10.0)
    (tmp_path / "campaign.toml").write_text(CAMPAIGN, "utf-8")
    (tmp_path / "study.toml").write_text(STUDY, "utf-8")
    found = studied(tmp_path)
    assert found.conditional_on == {}
    # The record is read up to the end of the last window of its run, and continued by prediction
    # from there: alone, a window ends with less of it.
    assert_cells_are_what_the_models_say(found, make_plan(study_of(tmp_path)), rtol=0, atol=3e-6)
    for test, windows, seconds in (("later", 2, 12.8), ("regular", 3, 8.0)):
        assert found.tests[test].sizes["window"] == windows
        assert found.tests[test]["time"][-1] == pytest.approx(seconds)
        for table in ("boxes", "coverage", "trend"):
            assert test in found.groups[f"statistics/{table}"]["test"].values
    assert found.tests["regular"]["start"].min() >= 12.0
    assert set(found.tests["regular"]["run"].values) == {"wave"}
    # The error in regular waves alone is taken apart.
    assert list(found.groups["statistics/response"]["test"].values) == ["regular"]
    assert_near(found.groups["runs"].sel(run="wave")["wave_frequency"], 0.6, 0.005)
