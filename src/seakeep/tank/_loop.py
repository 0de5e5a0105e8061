"""The compiled time loop: Cummins' equation by classical Runge–Kutta steps.

Imported only where a run is simulated; needs the extra ``tank`` (numba). Arrays in, arrays out;
`dynamics` prepares them and gives the results names.
"""

import math
from typing import Any, NamedTuple

import numba
import numpy as np

from seakeep.arrays import FloatArray, IntArray

# Reassociation lets the memory integral run in vector registers; NaN is still NaN. Contraction to
# fused multiply-adds is left out: code compiled in this process and code read from the cache fuse
# other pairs, and the last bits would differ between the first run and the second.
_fast = numba.njit(cache=True, fastmath={"reassoc"})
_exact = numba.njit(cache=True)


class Body(NamedTuple):
    """Vessel and moorings as the loop takes them; see `dynamics.Rig`."""

    inverse_mass: FloatArray
    stiffness: FloatArray
    linear: FloatArray
    quadratic: FloatArray
    pool: FloatArray
    lines: FloatArray


class Waves(NamedTuple):
    """Waves as the loop takes them.

    `components` holds one row each for ω, k, and the surge response (re, im) times the amplitude;
    `excitation` the forces times the amplitude, first the real parts; `drift` and `signs` the
    envelopes of the drift force, and `drift_damping` its damping.
    """

    components: FloatArray
    phase: FloatArray
    excitation: FloatArray
    signs: FloatArray
    drift: FloatArray
    drift_damping: float


@_exact
def line_tension(
    line: FloatArray, position: FloatArray, velocity: FloatArray
) -> tuple[float, float, float, float]:
    """Tension of a line and its force on the vessel.

    `line` is a row of `dynamics.line_table`. Returns tension, force along x and z, moment about y.
    """
    cosine, sine = math.cos(position[2]), math.sin(position[2])
    arm_x = line[0] * cosine + line[1] * sine
    arm_z = -line[0] * sine + line[1] * cosine
    dx, dz = line[2] - position[0] - arm_x, line[3] - position[1] - arm_z
    length = math.sqrt(dx * dx + dz * dz)
    stretch = length - line[5]
    if stretch <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    speed_x = velocity[0] + velocity[2] * arm_z
    speed_z = velocity[1] - velocity[2] * arm_x
    rate = -(dx * speed_x + dz * speed_z) / length
    tension = max(0.0, line[4] * stretch + line[6] * rate)
    force_x, force_z = tension * dx / length, tension * dz / length
    return tension, force_x, force_z, arm_z * force_x - arm_x * force_z


@_exact
def line_tensions(lines: FloatArray, position: FloatArray, velocity: FloatArray) -> FloatArray:
    """Tensions of all lines, shape (line, time), along a motion of shape (dof, time)."""
    out = np.zeros((lines.shape[0], position.shape[1]))
    for i in range(lines.shape[0]):
        for j in range(position.shape[1]):
            out[i, j] = line_tension(lines[i], position[:, j], velocity[:, j])[0]
    return out


@_fast
def _wave_forces(
    real: FloatArray,
    imag: FloatArray,
    surge: float,
    surge_speed: float,
    place: float,
    ramp: float,
    waves: Waves,
    moved: FloatArray,
    force: FloatArray,
) -> float:
    """Add wave and drift forces to `force`; return the slow part of surge.

    `real` and `imag` are the components' phases at `place`; `moved` is overwritten.
    """
    components, excitation, drift = waves.components, waves.excitation, waves.drift
    fast = fast_speed = 0.0
    for n in range(real.size):
        first = components[2, n] * real[n] - components[3, n] * imag[n]
        fast += first
        fast_speed += components[0, n] * (components[2, n] * imag[n] + components[3, n] * real[n])
    slow = surge - ramp * fast
    shift = slow - place
    for n in range(real.size):
        angle = components[1, n] * shift
        # Second order in k·shift: within a step the vessel moves millimetres.
        c, s = 1.0 - 0.5 * angle * angle, angle
        moved[0, n], moved[1, n] = real[n] * c - imag[n] * s, imag[n] * c + real[n] * s
    dofs, count = force.size, waves.signs.size
    now_re, now_im = moved[0], moved[1]
    for i in range(dofs):
        along, across, total = excitation[i], excitation[dofs + i], 0.0
        for n in range(real.size):
            total += along[n] * now_re[n] - across[n] * now_im[n]
        force[i] += ramp * total
    for i in range(count):
        along, across, re, im = drift[i], drift[count + i], 0.0, 0.0
        for n in range(real.size):
            re += along[n] * now_re[n] - across[n] * now_im[n]
            im += along[n] * now_im[n] + across[n] * now_re[n]
        force[0] += ramp * ramp * waves.signs[i] * (re * re + im * im)
    force[0] -= ramp * ramp * waves.drift_damping * (surge_speed - ramp * fast_speed)
    return slow


@_fast
def _body_forces(q: FloatArray, v: FloatArray, body: Body, force: FloatArray) -> None:
    """Add restoring, viscous, moon-pool and mooring forces to `force`."""
    dofs, pool = q.size, body.pool
    for i in range(dofs):
        total = body.linear[i] * v[i] + body.quadratic[i] * abs(v[i]) * v[i]
        for j in range(dofs):
            total += body.stiffness[i, j] * q[j]
        force[i] -= total
    if dofs > 3:
        # pool: centre, quadratic and linear loss of the flow through the opening.
        relative = v[3] - (v[1] - pool[0] * v[2])
        loss = pool[1] * abs(relative) * relative + pool[2] * relative
        force[3] -= loss
        force[1] += loss
        force[2] -= pool[0] * loss
    for i in range(body.lines.shape[0]):
        _, fx, fz, moment = line_tension(body.lines[i], q, v)
        force[0] += fx
        force[1] += fz
        force[2] += moment


@_fast
def _memory_ahead(
    pairs: IntArray, kernel: FloatArray, v: FloatArray, origin: int, out: FloatArray
) -> None:
    """Memory of the velocities up to column `origin`, for the next instant, less its own share."""
    length = kernel.shape[1] - 1
    out[:] = 0.0
    for p in range(pairs.shape[0]):
        total = 0.0
        past = v[pairs[p, 1], origin - length + 1 : origin + 1]
        lags = kernel[p]
        for m in range(length):
            total += lags[m] * past[m]
        out[pairs[p, 0]] += total


@_fast
def _phases(
    waves: Waves, place: float, time: float, dt: float, real: FloatArray, imag: FloatArray
) -> None:
    """Components' cosines and sines at `place`, now, half a step and a step later."""
    frequency, wavenumber = waves.components[0], waves.components[1]
    for n in range(waves.phase.size):
        for part in range(3):
            angle = wavenumber[n] * place - frequency[n] * (time + 0.5 * part * dt) + waves.phase[n]
            real[part, n], imag[part, n] = math.cos(angle), math.sin(angle)


@_fast
def _gain(slopes: FloatArray, dt: float, out: FloatArray) -> None:
    """Add the gain of a fourth-order step by the slopes of its four stages, shape (stage, dof)."""
    for i in range(out.size):
        total = slopes[0, i] + 2.0 * (slopes[1, i] + slopes[2, i]) + slopes[3, i]
        out[i] += dt / 6.0 * total


@_exact
def _ramp(elapsed: float, ramp_time: float) -> float:
    if elapsed >= ramp_time:
        return 1.0
    return 0.5 * (1.0 - math.cos(math.pi * elapsed / ramp_time))


@_fast
def integrate(
    steps: int,
    dt: float,
    ramp_time: float,
    start: FloatArray,
    body: Body,
    pairs: IntArray,
    kernel: FloatArray,
    waves: Waves,
    limits: FloatArray,
) -> tuple[Any, ...]:
    """Integrate the motion.

    `start` holds position and velocity, shape (2, dof); `kernel` the memory of each pair (row,
    column) of `pairs`, already times dt, its columns from the oldest lag to lag 0. Returns
    position, velocity, acceleration, radiation memory (dof, time), slow surge (time,), and the
    index and degree of freedom that passed a limit (−1 if none).
    """
    dofs, length, count = start.shape[1], kernel.shape[1] - 1, waves.phase.size
    q, a = np.zeros((dofs, steps + 1)), np.zeros((dofs, steps + 1))
    memory = np.zeros((dofs, steps + 1))
    v = np.zeros((dofs, steps + 1 + length))
    slow = np.zeros(steps + 1)
    q[:, 0], v[:, length] = start[0], start[1]
    now, ahead, force, previous = np.zeros(dofs), np.zeros(dofs), np.zeros(dofs), np.zeros(dofs)
    real, imag = np.zeros((3, count)), np.zeros((3, count))
    slopes, state = np.zeros((2, 4, dofs)), np.zeros((2, dofs))
    moved = np.zeros((2, count))
    place = start[0, 0]
    for step in range(steps + 1):
        origin = length + step  # column of v at this instant
        _memory_ahead(pairs, kernel, v, origin, ahead)
        _phases(waves, place, step * dt, dt, real, imag)
        for stage in range(4):
            part = (stage + 1) // 2
            fraction = 0.5 * part
            state[0], state[1] = q[:, step], v[:, origin]
            if stage > 0:
                state += fraction * dt * slopes[:, stage - 1]
            previous[:] = (1.0 - fraction) * now + fraction * ahead
            for p in range(pairs.shape[0]):
                previous[pairs[p, 0]] += kernel[p, length] * state[1, pairs[p, 1]]
            force[:] = -previous
            _body_forces(state[0], state[1], body, force)
            reached = _wave_forces(
                real[part], imag[part], state[0, 0], state[1, 0], place,
                _ramp((step + fraction) * dt, ramp_time), waves, moved, force,
            )  # fmt: skip
            slopes[0, stage] = state[1]
            for i in range(dofs):
                slopes[1, stage, i] = np.sum(body.inverse_mass[i] * force)
            if stage == 0:
                a[:, step], memory[:, step], slow[step] = slopes[1, 0], previous, reached
        if step == steps:
            break
        place = slow[step]
        q[:, step + 1], v[:, origin + 1] = q[:, step], v[:, origin]
        _gain(slopes[0], dt, q[:, step + 1])
        _gain(slopes[1], dt, v[:, origin + 1])
        now[:] = ahead
        for i in range(dofs):
            if not abs(q[i, step + 1]) < limits[i]:
                return q, v[:, length:], a, memory, slow, step + 1, i
    return q, v[:, length:], a, memory, slow, -1, -1
