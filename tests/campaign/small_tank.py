"""A small tank: two runs as a logger writes them, and a campaign file that reads them."""

from math import tau

import numpy as np
import pandas as pd

from seakeep import read_campaign

DT = 0.02


def tank_columns(seed=0, seconds=20.0):
    """Time (s), wave (mm), heave (mm), pitch (deg), acceleration (m/s²) of a made-up run."""
    t = DT * np.arange(int(seconds / DT) + 1)
    phase = np.random.default_rng(seed).uniform(0, tau, 5)
    omega = tau * np.array([0.5, 0.6, 0.7, 0.8, 0.9])
    waves = np.cos(omega * t[:, None] + phase)
    return {
        "Time [s]": t,
        "WP fwd [mm]": 20 * waves.sum(axis=1),
        "Heave [mm]": 15 * (waves * [1.0, 0.9, 0.7, 0.5, 0.3]).sum(axis=1),
        "Pitch (deg)": 2 * np.sin(omega * t[:, None] + phase).sum(axis=1),
        "acc [g]": 0.05 * waves[:, 0],
    }


def write_csv(path, columns):
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


def campaign_of(folder, text):
    """The campaign of a text, which is written into a folder."""
    path = folder / "campaign.toml"
    path.write_text(text, "utf-8")
    return read_campaign(path)


CAMPAIGN = """
[campaign]
name = "Small tank"
scale_factor = 30.0

[rig]
water_depth = 3.6

[rig.positions]
eta_fwd = -2.5

[channels.eta_fwd]
column = "WP fwd"

[channels.heave]
column = "Heave"

[channels.pitch]
column = "Pitch"

[channels.acc]
column = "acc [g]"
long_name = "acceleration of the bow"

[derived.pitch_rate]
from = "pitch"
step = "differentiate"

[runs.first]
file = "first.csv"
sea_state = "moderate"
train = [0, 10]
test = [10, inf]

[runs.second]
file = "second.csv"
role = "test"
span = [2, 18]

[preparation]
sampling_rate = 10

[model]
states = ["heave", "pitch"]
inputs = ["eta_fwd"]
state_delays = 4
input_delays = 8
ridge = 1
"""
