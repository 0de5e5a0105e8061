"""A small campaign of two loggers, and models of it."""

import numpy as np
from seas import sea
from small_tank import write_csv

CAMPAIGN = """
[campaign]
name = "Two loggers"
scale_factor = 50.0
period_channel = "eta_fwd"

[rig]
water_depth = 3.0
wave_direction = 0.0

[rig.positions]
eta_fwd = -1.0
eta_mid = 0.0

[files]
time = "t [s]"
time_unit = "s"

[channels.eta_fwd]
column = "p1"
unit = "cm"

[channels.eta_mid]
column = "p2"
unit = "cm"

[channels.heave]
unit = "m"

[channels.pitch]
unit = "deg"

[channels.surge]
unit = "m"

[derived.heave_rate]
from = "heave"
step = "differentiate"

[derived.eta_low]
from = "eta_fwd"
step = "low_pass"
passband = 2.0
stopband = 3.0

[derived.sum]
expression = "heave + 2*eta_mid"
unit = "m"

[derived.twice]
from = "heave"
step = "integrate"
times = 1
band = [0.2, 2.0]

[redundant.wave]
channels = ["eta_fwd", "eta_mid"]
window = 10.0

[instruments]
reference = "probes"

[instruments.probes]
sampling_rate = 10.0
trigger = "trigger"

[instruments.mru]
sampling_rate = 20.0
trigger = "trigger"
window = 20.0
largest_lag = 5.0

[runs.one]
sea_state = "sea"
waves = "irregular"
train = [2.0, 40.0]
test = [40.5, 58.0]

[runs.one.files]
probes = "one_probes.csv"
mru = "one_mru.csv"

[preparation]
sampling_rate = 8.0
gaps = "bridge"
longest_gap = 0.3
attenuation = 60.0

[model]
states = ["heave", "pitch"]
inputs = ["eta_fwd", "eta_mid"]
state_delays = 2
input_delays = "1 T"
lead = 0
ridge = 0.1
window = "inf T"
observables = [{ kind = "expression", name = "square", expression = "eta_fwd**2" }]

[model.alignment]
mode = "effective"
surge = "measured"

[models.ensemble]
kind = "bayesian_hankel_dmdc"
states = ["heave", "pitch"]
inputs = ["eta_fwd"]
n_members = 3
window = { uniform = ["10 T", "20 T"] }
state_delays = { uniform = ["0.3 T", "0.6 T"] }
input_delays = 1.0
ridge = { log_uniform = [0.05, 0.5] }
seed = 1

[models.arx]
kind = "arx"
states = ["heave", "pitch"]
inputs = ["eta_fwd"]

[models.subspace]
kind = "subspace"
order = 6
state_delays = 8
input_delays = 8
future = 9
states = ["heave", "pitch"]
inputs = ["eta_fwd"]

[models.hold]
kind = "hold_last"
states = ["heave", "pitch"]
inputs = ["eta_fwd"]
"""


def write_raw(folder, run, seed):
    waves, rng = sea(seed, (0.4, 0.9), components=12).at, np.random.default_rng(seed)

    def noisy(t, size, lag):
        return 2.5 * size * waves(t - lag) + 0.02 * rng.standard_normal(t.size)

    probes = {"p1": (1.0, 0.0), "p2": (1.0, 0.6)}
    motions = {"heave": (0.3, 0.9), "pitch": (1.0, 0.5), "surge": (0.1, 1.0)}
    for logger, step, columns in (("probes", 0.1, probes), ("mru", 0.05, motions)):
        t = np.arange(0.0, 60.0, step)
        pulses = 5.0 * (np.mod(t - 3.0, 10.0) < 0.55)
        series = {name: noisy(t, *of) for name, of in columns.items()}
        write_csv(folder / f"{run}_{logger}.csv", {"t [s]": t, **series, "trigger": pulses})


def write(folder):
    """Write settings and raw files into a folder; gives the campaign file."""
    path = folder / "campaign.toml"
    path.write_text(CAMPAIGN, "utf-8")
    write_raw(folder, "one", 1)
    return path
