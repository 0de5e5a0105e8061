"""The measurement chain: functions on sampled series, each usable alone.

Series are arrays with time along the first axis; instants and steps are in seconds, frequencies
in hertz. Nothing here knows of files, the tracking of a video aside.
"""

from seakeep.signals.agreement import compare_motion
from seakeep.signals.alignment import delay_by_celerity, delay_by_dispersion
from seakeep.signals.blending import blend
from seakeep.signals.celerity import correlation_peak, effective_celerity, phase_celerity
from seakeep.signals.clocks import resample, uniform_step
from seakeep.signals.derive import band_pass, differentiate, envelope_squared, integrate
from seakeep.signals.filters import low_pass, lowpass_taps
from seakeep.signals.froude import froude_factor, to_full_scale
from seakeep.signals.gaps import TimeReport, bridge, inspect_times, onto_uniform
from seakeep.signals.lags import Lags, windowed_lags
from seakeep.signals.repeats import find_repeat
from seakeep.signals.rigid_body import (
    remove_gravity,
    rotation_matrix,
    transfer_acceleration,
    transfer_position,
    transfer_velocity,
)
from seakeep.signals.separation import misplaced_probes, probe_separation
from seakeep.signals.spectra import (
    encounter_period,
    peak_period,
    significant_height,
    wave_heights,
    wave_spectrum,
    wave_statistics,
    waves_part,
    zero_up_crossings,
)
from seakeep.signals.synchronise import (
    Clock,
    clock_from_correlation,
    clock_from_pulses,
    clock_from_shared,
    pool_drift,
)
from seakeep.signals.tracking import TrackingSettings, track_video

__all__ = [
    "Clock",
    "Lags",
    "TimeReport",
    "TrackingSettings",
    "band_pass",
    "blend",
    "bridge",
    "clock_from_correlation",
    "clock_from_pulses",
    "clock_from_shared",
    "compare_motion",
    "correlation_peak",
    "delay_by_celerity",
    "delay_by_dispersion",
    "differentiate",
    "effective_celerity",
    "encounter_period",
    "envelope_squared",
    "find_repeat",
    "froude_factor",
    "inspect_times",
    "integrate",
    "low_pass",
    "lowpass_taps",
    "misplaced_probes",
    "onto_uniform",
    "peak_period",
    "phase_celerity",
    "pool_drift",
    "probe_separation",
    "remove_gravity",
    "resample",
    "rotation_matrix",
    "significant_height",
    "to_full_scale",
    "track_video",
    "transfer_acceleration",
    "transfer_position",
    "transfer_velocity",
    "uniform_step",
    "wave_heights",
    "wave_spectrum",
    "wave_statistics",
    "waves_part",
    "windowed_lags",
    "zero_up_crossings",
]
