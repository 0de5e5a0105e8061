"""Samples of several topics, each with stamps of its own, at the instants of a live model.

Nothing here knows ROS: `node.py` does.
"""

from collections import deque
from math import isfinite, nan

STARTING = 4
"""Complete samples with which a live model must start."""


class Follower:
    """Feeds a live model with what arrived.

    A sample belongs to the instant that is nearest to its stamp, within half a step; of several,
    the nearest counts. An instant is over half a step after it, plus `patience` for messages that
    come late. Inputs that are missing then are predicted, states that are missing are estimated.

    Parameters
    ----------
    model : model or HeldEnsemble
        What has a method ``live()``.
    live : Live, optional
        A state to continue from; by default the follower starts when all inputs arrive.
    patience : float
        How late a message may be, s.
    longest : float
        After a gap of all inputs that is longer than this, s, the follower starts anew.
    """

    def __init__(self, model, live=None, patience=0.0, longest=60.0):
        self.model, self.live = model, model.live() if live is None else live
        self.patience, self.longest = patience, longest
        self.dt, self.inputs = model.dt, list(model.inputs)
        self.waiting = {name: deque() for name in [*model.inputs, *model.states]}
        self.next = self.live.time + self.dt  # NaN before the start
        self.steps = 0 if live is None else STARTING

    def receive(self, channel, stamp, value):
        """Take one measured value; one that is not finite or comes too late is left out."""
        if isfinite(value) and not stamp < self.next - self.dt / 2:
            self.waiting[channel].append((stamp, value))

    def advance(self, now):
        """Estimates of the instants that are over: a list of (instant, states)."""
        found = []
        if not isfinite(self.next) and not self._begin():
            return found
        if now - self.next > self.longest:
            self._restart()
            return found
        while self.next + self.dt / 2 + self.patience <= now:
            inputs = {name: self._nearest(name) for name in self.inputs}
            states = {name: self._nearest(name) for name in self.model.states}
            complete = all(map(isfinite, inputs.values()))
            if not complete and self.steps < STARTING:
                self._restart()
                return found
            state = self.live.step(inputs if complete else None, states, time=self.next)
            found.append((self.next, state))
            self.next, self.steps = self.next + self.dt, self.steps + 1
        return found

    def _begin(self):
        """Start where the first samples of the inputs end, when all of them are there."""
        firsts = [self.waiting[name] for name in self.inputs or self.model.states]
        if not all(firsts):
            return False
        self.next = max(each[0][0] for each in firsts)
        return True

    def _restart(self):
        self.live, self.next, self.steps = self.model.live(), nan, 0
        for each in self.waiting.values():
            each.clear()

    def _nearest(self, channel):
        """Value nearest to the instant, NaN without one; what is older is forgotten."""
        waiting, best, value = self.waiting[channel], self.dt / 2, nan
        while waiting and waiting[0][0] < self.next + self.dt / 2:
            stamp, each = waiting.popleft()
            if abs(stamp - self.next) <= best:
                best, value = abs(stamp - self.next), each
        return value
