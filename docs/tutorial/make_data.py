"""Make the small synthetic campaign of the tutorial: three runs of a barge-like vessel.

A linear heave and pitch response with a quadratic damping in pitch is driven by irregular waves,
and written as a wave flume writes it: centimetres, degrees, newtons, odd names, noise. Run it in
this folder to make the files again; the same seed gives the same bytes.
"""

from pathlib import Path

import numpy as np

SEED = 20
RATE = 25.0
DURATION = 120.0
DEPTH = 1.5
HEADER = "t [s];WP_01 [cm];WP_02 [cm];HEAVE_MRU [cm];PITCH_MRU [deg];FWD_LINE [N]\n"


def wavenumber(omega):
    k = omega**2 / 9.81
    for _ in range(100):
        k = omega**2 / (9.81 * np.tanh(k * DEPTH))
    return k


def waves(rng, time):
    """Elevation 2 m ahead of the vessel and at it, from 80 components of a JONSWAP-like sea."""
    edges = np.linspace(0.35, 1.6, 81)
    frequency = rng.uniform(edges[:-1], edges[1:])
    peak, height = 0.6, 0.06
    density = frequency**-5 * np.exp(-1.25 * (peak / frequency) ** 4)
    amplitude = np.sqrt(2 * density * np.diff(edges))
    amplitude *= height / 4 / np.sqrt(np.sum(amplitude**2) / 2)
    omega = 2 * np.pi * frequency
    phase = rng.uniform(0, 2 * np.pi, omega.size)
    k = np.array([wavenumber(each) for each in omega])

    def at(x):
        return (amplitude * np.cos(k * x - np.multiply.outer(time, omega) + phase)).sum(axis=-1)

    return at(-2.0), at(0.0), at(0.35) - at(-0.35)


def respond(eta, slope, step):
    """Heave (m), pitch (rad) and the load of the bow line (N), by RK4 on the fine grid."""

    def rates(state, wave, tilt):
        z, w, theta, q = state
        return np.array(
            [
                w,
                (2 * np.pi * 0.85) ** 2 * (wave - z) - 2 * 0.25 * 2 * np.pi * 0.85 * w,
                q,
                (2 * np.pi * 0.75) ** 2 * (-0.9 * tilt / 0.7 - theta)
                - 2 * 0.06 * 2 * np.pi * 0.75 * q
                - 1.5 * abs(q) * q,
            ]
        )

    states = np.zeros((eta.size, 4))
    for k in range(eta.size - 1):
        middle = 0.5 * (eta[k] + eta[k + 1]), 0.5 * (slope[k] + slope[k + 1])
        a = rates(states[k], eta[k], slope[k])
        b = rates(states[k] + 0.5 * step * a, *middle)
        c = rates(states[k] + 0.5 * step * b, *middle)
        d = rates(states[k] + step * c, eta[k + 1], slope[k + 1])
        states[k + 1] = states[k] + step / 6 * (a + 2 * b + 2 * c + d)
    load = np.maximum(0.0, 4.0 + 25.0 * states[:, 0] - 30.0 * states[:, 2])
    return states[:, 0], states[:, 2], load


def main(folder):
    for number, child in enumerate(np.random.default_rng(SEED).spawn(3), start=1):
        fine = 8
        time = np.arange(int((DURATION + 20) * RATE * fine)) / (RATE * fine)
        forward, here, slope = waves(child, time)
        heave, pitch, load = respond(here, slope, time[1])
        kept = slice(int(20 * RATE * fine), None, fine)
        columns = np.column_stack(
            [
                np.arange(int(DURATION * RATE)) / RATE,
                100 * forward[kept] + child.normal(0, 0.03, forward[kept].size),
                100 * here[kept] + child.normal(0, 0.03, forward[kept].size),
                100 * heave[kept] + child.normal(0, 0.02, forward[kept].size),
                np.degrees(pitch[kept]) + child.normal(0, 0.03, forward[kept].size),
                load[kept] + child.normal(0, 0.02, forward[kept].size),
            ]
        )
        with (folder / f"run{number}.csv").open("w", encoding="utf-8", newline="\n") as stream:
            stream.write(HEADER)
            for row in columns:
                stream.write(";".join([f"{row[0]:.2f}", *(f"{v:.3f}" for v in row[1:])]) + "\n")


if __name__ == "__main__":
    main(Path(__file__).parent)
