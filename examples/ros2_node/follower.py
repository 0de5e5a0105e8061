"""Samples of several topics, each with stamps of its own, at the instants of a live model.

Nothing here knows ROS: `node.py` does.
"""

from collections import Counter
from math import isfinite, nan

import numpy as np

STARTING = 4
"""Samples with all inputs that a live model starts with."""


class Follower:
    """Feed a live model with what arrived.

    A value counts if its stamp is within `patience` of the clock when it arrives. It belongs to
    the instant of the model's grid that is nearest to its stamp; of several, the nearest one
    counts. An instant is over half a step and `patience` after it, so the order of arrival does
    not matter. Inputs that are missing then are predicted, states that are missing are estimated.

    Parameters
    ----------
    start : callable
        Makes a new live model: ``lambda: model.live(like=run)``.
    live : Live, optional
        A state to continue from; by default the follower starts when all inputs arrive.
    patience : float
        How far a stamp may be before or after the clock, s.
    longest : float
        The follower starts anew after this time without any input, s. It also does so where the
        clock is set back by more than `patience`.

    Attributes
    ----------
    live : Live
        The live model.
    lost : Counter
        Numbers by channel and reason: values that came "late", "early" or "not finite", and
        instants for which one was "missing". Starts are counted under "all".
    """

    def __init__(self, start, live=None, *, patience=0.1, longest=60.0):
        self.start, self.live = start, start() if live is None else live
        self.patience, self.longest = patience, longest
        signature = self.live.signature
        self.dt, self.inputs, self.states = signature.dt, signature.inputs, signature.states
        self.waiting = {name: [] for name in [*self.inputs, *self.states]}
        self.steps = 0 if live is None else STARTING
        self.first = self.live.time - (STARTING - 1) * self.dt  # instant of the first step
        self.fed = self.live.time  # when the last input came; NaN before
        self.lost = Counter()

    def receive(self, channel, stamp, value, now):
        """Take a measured value that arrived when the clock showed `now`."""
        self._check_clock(now)
        if not isfinite(value):
            self.lost[channel, "not finite"] += 1
        elif now - stamp > self.patience:
            self.lost[channel, "late"] += 1
        elif stamp - now > self.patience:
            self.lost[channel, "early"] += 1
        else:
            self.waiting[channel].append((stamp, value))
            if channel in (self.inputs or self.states):
                self.fed = now

    def advance(self, now):
        """Instants that are over: a list of (instant, states, their standard deviations)."""
        self._check_clock(now)
        found, over = [], now - self.patience - self.dt / 2
        while (instant := self._next()) <= over:
            sample = {name: self._nearest(name, instant) for name in self.waiting}
            missing = [name for name, value in sample.items() if not isfinite(value)]
            if self.steps < STARTING and set(missing) & set(self.inputs):
                self._start_anew("waiting for all inputs")
                continue
            self.lost.update((name, "missing") for name in missing)
            self.first = self.first if self.steps else instant
            u, y = ([sample[name] for name in of] for of in (self.inputs, self.states))
            states = self.live.step(u, y, time=instant)
            found.append((instant, states, np.sqrt(np.diagonal(self.live.covariance))))
            self.steps += 1
        if not self.steps:  # no instant can need what is older
            for name, waiting in self.waiting.items():
                self.waiting[name] = [each for each in waiting if each[0] > over - self.dt]
        return found

    def _next(self):
        """The instant to come: without one before, the first for which an input is there."""
        if self.steps:
            return self.first + self.steps * self.dt  # a sum of steps would drift
        driving = self.inputs or self.states
        return min((stamp for name in driving for stamp, _ in self.waiting[name]), default=nan)

    def _nearest(self, channel, instant):
        """Value nearest to the instant, NaN without one; what is older is forgotten."""
        half, waiting = self.dt / 2, self.waiting[channel]
        self.waiting[channel] = [each for each in waiting if each[0] >= instant + half]
        near = [(abs(stamp - instant), stamp, value) for stamp, value in waiting]
        return min((each for each in near if each[0] <= half), default=(0, 0, nan))[2]

    def _check_clock(self, now):
        if now - self.fed > self.longest or self.fed - now > self.patience:
            self._start_anew("no input for long, or a clock that was set")
            self.fed, self.waiting = nan, {name: [] for name in self.waiting}

    def _start_anew(self, why):
        if self.steps:
            self.live, self.steps = self.start(), 0
        self.lost["all", why] += 1
