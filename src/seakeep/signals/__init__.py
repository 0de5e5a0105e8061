"""The measurement chain: independent functions on sampled series.

Series are arrays with time along the first axis; instants and steps are in seconds, frequencies
in hertz. Only the tracking of a video reads a file.
"""

from seakeep.conventions import froude_factor
from seakeep.signals.calculus import (
    band_pass,
    complementary_filter,
    differentiate,
    envelope_squared,
    integrate,
)
from seakeep.signals.filters import low_pass, lowpass_taps, resample
from seakeep.signals.lags import (
    Lags,
    MotionAgreement,
    compare_motion,
    correlation_peak,
    windowed_lags,
)
from seakeep.signals.prediction import predict_waves
from seakeep.signals.propagation import (
    carry_by_celerity,
    carry_by_dispersion,
    effective_celerity,
    misplaced_probes,
    probe_separation,
)
from seakeep.signals.rigid_body import (
    remove_gravity,
    rotation_matrix,
    transfer_acceleration,
    transfer_position,
    transfer_velocity,
)
from seakeep.signals.synchronisation import (
    clock_from_correlation,
    clock_from_pulses,
    clock_from_shared,
    pool_drift,
)
from seakeep.signals.time_axis import (
    Clock,
    TimeReport,
    bridge,
    inspect_times,
    onto_uniform,
    uniform_step,
)
from seakeep.signals.tracking import Track, TrackingSettings, contact_sheet, track_video
from seakeep.signals.waves import (
    encounter_period,
    find_leakage,
    peak_period,
    repeated_waves,
    significant_height,
    wave_heights,
    wave_spectrum,
    wave_statistics,
    waves_part,
    zero_up_crossings,
)

__all__ = [
    "Clock",
    "Lags",
    "MotionAgreement",
    "TimeReport",
    "Track",
    "TrackingSettings",
    "band_pass",
    "bridge",
    "carry_by_celerity",
    "carry_by_dispersion",
    "clock_from_correlation",
    "clock_from_pulses",
    "clock_from_shared",
    "compare_motion",
    "complementary_filter",
    "contact_sheet",
    "correlation_peak",
    "differentiate",
    "effective_celerity",
    "encounter_period",
    "envelope_squared",
    "find_leakage",
    "froude_factor",
    "inspect_times",
    "integrate",
    "low_pass",
    "lowpass_taps",
    "misplaced_probes",
    "onto_uniform",
    "peak_period",
    "pool_drift",
    "predict_waves",
    "probe_separation",
    "remove_gravity",
    "repeated_waves",
    "resample",
    "rotation_matrix",
    "significant_height",
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
