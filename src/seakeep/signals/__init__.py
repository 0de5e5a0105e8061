"""The measurement chain: functions on sampled series, each usable alone.

Series are arrays with time along the first axis; instants and steps are in seconds, frequencies
in hertz. Nothing here knows of files, the tracking of a video aside.
"""

from seakeep.signals.agreement import compare_motion
from seakeep.signals.alignment import delay_by_celerity, delay_by_dispersion
from seakeep.signals.celerity import correlation_peak, effective_celerity, phase_celerity
from seakeep.signals.clocks import resample, uniform_step
from seakeep.signals.derive import band_pass, differentiate, envelope_squared, integrate
from seakeep.signals.filters import low_pass, lowpass_taps
from seakeep.signals.repeats import find_repeat
from seakeep.signals.spectra import (
    encounter_period,
    peak_period,
    significant_height,
    wave_heights,
    wave_spectrum,
    wave_statistics,
    zero_up_crossings,
)
from seakeep.signals.tracking import TrackingSettings, track_video

__all__ = [
    "TrackingSettings",
    "band_pass",
    "compare_motion",
    "correlation_peak",
    "delay_by_celerity",
    "delay_by_dispersion",
    "differentiate",
    "effective_celerity",
    "encounter_period",
    "envelope_squared",
    "find_repeat",
    "integrate",
    "low_pass",
    "lowpass_taps",
    "peak_period",
    "phase_celerity",
    "resample",
    "significant_height",
    "track_video",
    "uniform_step",
    "wave_heights",
    "wave_spectrum",
    "wave_statistics",
    "zero_up_crossings",
]
