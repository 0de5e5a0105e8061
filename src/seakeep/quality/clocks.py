"""Checks of time: clocks, rates and records of the loggers, the common step, the period."""

from statistics import median_high, median_low

import numpy as np

from seakeep.conventions import MOTIONS, is_elevation
from seakeep.quality.faults import noise_share
from seakeep.quality.findings import Finding, Findings, Kind, Record, sound, step_of
from seakeep.signals import Clock
from seakeep.signals.filters import PASSBAND
from seakeep.signals.time_axis import ASSUMED
from seakeep.signals.waves import energy_above

RATE_TOLERANCE = 0.01
"""Part by which a stated rate may differ from the times: rates are written with two digits or more,
and quartzes keep theirs a thousand times better."""

LARGEST_DRIFT = 2e-4
"""Drift of a clock that is reported: ten times that of a poor quartz."""

LOST = 0.05
"""Part of a run's used span that a logger may miss: they are started and stopped by hand, seconds
apart, and runs last minutes."""

LOST_ENERGY = 0.05
"""Part of the waves' energy that a step may cost: 2.5 % of their standard deviation, more than a
calibrated probe leaves open (1 to 2 %)."""

FINER = 2.0
"""Times finer than the fastest logger that a step may be: one of 32 to a period is so where the
loggers take 16, the fewest that show a wave's shape."""

_FILE = (
    "Check whether its file is whole; if it is, state span = [start, end] in [runs.{run}] to say "
    "which part is meant."
)


class ClocksKind(Kind):
    """Findings about time."""

    TIME_GAPS = "time has {gaps} gap(s): {missing} samples are missing"
    JITTER = "time has a jitter of {jitter:.3g} ms RMS; interpolated onto a uniform step"
    TIMES_ASIDE = (
        "counted at the {limit:g} stated; the file's own times, which are left aside, give "
        "{value:.5g}. Leave sampling_rate out, or correct it"
    )
    COUNTED = (
        "counts 1, 2, 3 and states no unit: taken for seconds",
        "If it counts samples, {away} and state sampling_rate (Hz) in [{table}]; if these are "
        "seconds, state time_unit = 's' there.",
    )
    OTHER_RATE = "samples at {value:.5g}, by its times; {limit:g} are stated"
    ASSUMED_CLOCK = (
        "clock assumed the same as the reference's: state trigger, shared, correlated or offset (0 "
        "where the two run on one clock) in [instruments.{channel}]"
    )
    UNCERTAIN_CLOCK = "clock poorly known: ± {value:.2g} at the start of its record; {described}"
    CLOCK_DRIFT = "clock drifts by {value:+.0f} ppm"
    STARTS_LATE = (
        "starts at {value:.4g}, the other loggers at {limit:.4g}: the run is cut to what all "
        "recorded",
        _FILE,
    )
    ENDS_EARLY = (
        "ends at {value:.4g}, the other loggers at {limit:.4g}: the run is cut to what all "
        "recorded",
        _FILE,
    )
    RATE = (
        "is sampled at {value:g}, which is assumed: no file states its rate",
        "All periods and rates follow from it. Correct sampling_rate in [{table}], and remove "
        "sampling_rate_assumed there.",
    )
    FINE_STEP = (
        "put on {value:.4g}, and no logger records more than {limit:.4g}: nothing is gained, and "
        "models take longer"
    )
    COARSE_STEP = (
        "loses {share:.2g} % of the energy of its waves (peak at {period:.3g} s): it lies above "
        "{limit:.3g} and {fate} at {value:.4g}; take a finer step"
    )
    LOW_PASS = (
        "loses {share:.3g} % of the energy of its waves (peak at {period:.3g} s) to the filter "
        "low_pass, which halves what lies at {limit:.3g}",
        "Raise low_pass in [preparation] above the waves, or leave it out.",
        True,
    )
    PERIOD = (
        "counts waves of {value:.3g}, and the energy period of its spectrum is {limit:.3g}",
        "Noise or a slow drift of the probe leads the count, or waves too low for "
        "period_hysteresis are left out, and all that is stated in encounter periods is wrong with "
        "it. In [campaign], state period_hysteresis (0.2 passes noise of a twentieth of the "
        "waves), another period_channel, or encounter_period in seconds.",
        True,
    )
    LEFT_OUT = "{words}"


def clocks(record: Record) -> Findings:
    """Gaps, jitter, rates that differ from the stated one, clocks that are not certain."""
    for name, group in record.groups.items():
        label, clock, step = name or "time", record.clocks.get(name, Clock()), step_of(group)
        if gaps := group.attrs.get("time_gaps"):
            yield record.finding(
                ClocksKind.TIME_GAPS, label, gaps=gaps, missing=group.attrs["time_missing"]
            )
        if jitter := group.attrs.get("time_jitter_rms"):
            yield record.finding(ClocksKind.JITTER, label, jitter, unit="s", jitter=1e3 * jitter)
        if rate := record.rates.get(name):
            aside = group.attrs.get("time_column_step", 1 / rate.stated)
            if abs(aside * rate.stated - 1) > RATE_TOLERANCE:
                yield record.finding(ClocksKind.TIMES_ASIDE, label, 1 / aside, rate.stated, "Hz")
            elif abs(step * rate.stated - 1) > RATE_TOLERANCE:
                yield record.finding(ClocksKind.OTHER_RATE, label, 1 / step, rate.stated, "Hz")
        if clock.method == ASSUMED:
            yield record.finding(ClocksKind.ASSUMED_CLOCK, label)
        error, limit = clock.reading_error(float(group["time"][0])), 0.25 * step
        if error > limit or clock.residual > 0.5 * step:
            yield record.finding(
                ClocksKind.UNCERTAIN_CLOCK, label, error, limit, "s", described=clock.describe()
            )
        if abs(clock.drift) > LARGEST_DRIFT:
            yield record.finding(
                ClocksKind.CLOCK_DRIFT, label, 1e6 * clock.drift, 1e6 * LARGEST_DRIFT, "1"
            )


def rates(record: Record) -> Findings:
    """Loggers whose rate is a guess, or whose times may count samples."""
    for name, group in record.groups.items():
        rate, label = record.rates.get(name), name or "time"
        table = f"instruments.{name}" if name else "files"
        if group.attrs.get("time_counts"):
            away = "export its file without this column" if name else "leave time out"
            yield record.finding(ClocksKind.COUNTED, label, table=table, away=away)
        if rate and rate.assumed:
            yield record.finding(ClocksKind.RATE, label, rate.stated, unit="Hz", table=table)


def records(record: Record) -> Findings:
    """Loggers that start well after the others of their run, or end well before them.

    The others are judged by their median, so that one that was left running speaks against none.
    What lies outside the span that is used does no harm.
    """
    if len(record.groups) < 2:
        return
    spans = {n: (float(g["time"][0]), float(g["time"][-1])) for n, g in record.groups.items()}
    first = max(median_low(start for start, _ in spans.values()), record.span[0])
    last = min(median_high(end for _, end in spans.values()), record.span[1])
    limit = LOST * (last - first)
    for name, (start, end) in spans.items():
        if start - first > limit:
            yield record.finding(ClocksKind.STARTS_LATE, name, start, first, "s", start)
        if last - end > limit:
            yield record.finding(ClocksKind.ENDS_EARLY, name, end, last, "s", end)


def steps(record: Record) -> Findings:
    """Steps that are too coarse for the waves, or finer than any logger's."""
    if not record.groups:
        return
    dt = step_of(record.whole)
    own = {name: step_of(group) for name, group in record.groups.items()}
    finest = min(own.values())
    if round(finest / dt, 3) > FINER:
        yield record.finding(ClocksKind.FINE_STEP, "time", 1 / dt, 1 / finest, "Hz")
    # A filter halves amplitudes in the middle between its pass band and the Nyquist frequency.
    edge = (0.5 * (PASSBAND + 1.0) if record.anti_alias else 1.0) * 0.5 / dt
    fate = "is damped or lost" if record.anti_alias else "is folded into slower waves"
    for logger, group, name, _ in record.recorded():
        x = sound(group, name)
        if x.size < 2 or not (is_elevation(name) or name in MOTIONS):
            continue
        cuts = [(ClocksKind.COARSE_STEP, edge)] if own[logger] < dt else []
        if passed := record.whole[name].attrs.get("low_pass"):
            cuts.append((ClocksKind.LOW_PASS, float(np.mean(passed))))
        for kind, cut in cuts:
            share, period = energy_above(x, own[logger], cut)
            if share > LOST_ENERGY and noise_share(x) < 0.5:
                yield record.finding(
                    kind, name, 1 / dt, cut, "Hz", share=100 * share, period=period, fate=fate
                )


def others(record: Record) -> Findings:
    """Runs left out of the pooled period and clocks."""
    for run, words in record.left_out.items():
        yield Finding(ClocksKind.LEFT_OUT, run, f"run {run}", details={"words": words})
