"""The measurement chain: functions on sampled series, each usable alone.

Series are arrays with time along the first axis; instants and steps are in seconds, frequencies
in hertz. Nothing here knows of files.
"""

from seakeep.signals.clocks import resample, uniform_step
from seakeep.signals.derive import band_pass, differentiate, envelope_squared, integrate
from seakeep.signals.filters import low_pass, lowpass_taps
from seakeep.signals.spectra import (
    encounter_period,
    significant_height,
    wave_heights,
    wave_spectrum,
    zero_up_crossings,
)

__all__ = [
    "band_pass",
    "differentiate",
    "encounter_period",
    "envelope_squared",
    "integrate",
    "low_pass",
    "lowpass_taps",
    "resample",
    "significant_height",
    "uniform_step",
    "wave_heights",
    "wave_spectrum",
    "zero_up_crossings",
]
