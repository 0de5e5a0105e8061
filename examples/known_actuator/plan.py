"""Plan a thruster by what a model foresees: hold a vessel of the virtual tank near its mean place.

    seakeep tank --out virtual
    python examples/known_actuator/plan.py virtual/campaign.toml

The tank has no thruster. Its effect is superposed, as that of a force on a slow, lightly damped
surge: two runs with random thrust train the model, and a third one is played to it. Every two
seconds a plan over the next ones is made from the forecast without thrust and the linear answer to
it (`model.jacobian`); waves to come are not known.
"""

import sys

import numpy as np
from scipy import optimize, signal

import seakeep
from seakeep.campaign import load_prepared

PERIOD, DAMPING = 40.0, 0.15  # of the surge, s, and the ratio to critical
LIMIT = 0.03  # m/s², thrust over mass
BLOCK, BLOCKS = 2.0, 10  # s for which a thrust stays, and how many are planned
STATES, WAVES = ["surge", "surge_rate"], ["eta_fwd", "eta_cog"]


def thruster(dt):
    """Surge and its rate by the thrust that was held over each step, as a discrete system."""
    omega = 2 * np.pi / PERIOD
    a = np.array([[0.0, 1.0], [-(omega**2), -2 * DAMPING * omega]])
    system = signal.cont2discrete((a, np.array([[0.0], [1.0]]), np.eye(2), np.zeros((2, 1))), dt)
    return system[0], system[1][:, 0]


def thrusted(run, thrust):
    """The run with the thrust, and with what it adds to surge and surge rate."""
    a, b = thruster(float(run["time"][1] - run["time"][0]))
    moved = np.zeros((run.sizes["time"], 2))
    for k in range(len(moved) - 1):
        moved[k + 1] = a @ moved[k] + b * thrust[k]
    out = run[STATES + WAVES].copy(deep=True)
    for column, name in enumerate(STATES):
        out[name].values += moved[:, column]
    out["thrust"] = ("time", thrust, {"units": "m/s^2"})
    return out


def fit(runs, seed=0):
    """A model of runs in which the thrust is random, and changes every eight seconds."""
    rng, trained = np.random.default_rng(seed), {}
    for name, run in runs.items():
        count = run.sizes["time"]
        each = round(8.0 / float(run["time"][1] - run["time"][0]))
        levels = rng.uniform(-LIMIT, LIMIT, count // each + 1)
        trained[name] = thrusted(run, np.repeat(levels, each)[:count])
    dt = float(run["time"][1] - run["time"][0])
    period = float(run.attrs["encounter_period"])
    spec = seakeep.HankelDMDc(round(period / dt), round(2 * period / dt), ridge=10.0)
    return spec.fit(trained, STATES, [*WAVES, "thrust"])


def answer(model, x_history, u_history, steps):
    """Surge at the next instants per unit of each thrust in a plan, shape (steps, BLOCKS)."""
    on_states, on_inputs = model.jacobian(x_history, u_history)
    each, rows, reach = round(BLOCK / model.dt), on_states.shape[1], on_inputs.shape[1]
    out = np.zeros((steps, BLOCKS))
    for block in range(BLOCKS):
        thrust = np.zeros(reach + steps)
        thrust[reach + block * each : reach + (block + 1) * each] = 1.0  # from k + 1 on
        states = np.zeros((rows + steps, len(STATES)))
        for k in range(steps):
            states[rows + k] = np.tensordot(on_states, states[k : k + rows], 2)
            states[rows + k] += on_inputs[:, :, -1] @ thrust[k : k + reach]
        out[:, block] = states[rows:, 0]
    return out


def play(model, run, plans=True):
    """Surge of the run from when the model is ready, with planned thrust or without any."""
    a, b = thruster(model.dt)
    target = model.state_scale.centre[0]
    live = model.live(roles={"thrust": "known"})
    each, steps = round(BLOCK / model.dt), round(BLOCK * BLOCKS / model.dt)
    waves = np.stack([run[name].values for name in WAVES], axis=1)
    rest = np.stack([run[name].values for name in STATES], axis=1)
    moved, thrust, samples, linear = np.zeros(2), 0.0, [], None
    for k in range(len(rest)):
        samples.append((rest[k] + moved, [*waves[k], thrust]))
        live.step(samples[-1][1], samples[-1][0])
        moved = a @ moved + b * thrust
        if plans and live.ready and k % each == 0:
            if linear is None:  # the model is linear: one answer serves for all
                linear = answer(model, *map(np.array, zip(*samples, strict=True)), steps)
            still = live.forecast(steps, {"thrust": np.zeros(steps)}).surge.sel(statistic="mean")
            best = optimize.lsq_linear(linear, target - still.values, (-LIMIT, LIMIT))
            thrust = float(best.x[0])  # from the next sample on, until the next plan
    return np.array([y[0] for y, _ in samples[model.history_samples :]])


def main(campaign):
    """Train on two runs of irregular waves, and play the third with plans and without."""
    runs = load_prepared(seakeep.read_campaign(campaign))
    model = fit({name: runs[name] for name in ("irregular_1", "irregular_2")})
    for plans in (False, True):
        away = play(model, runs["irregular_3"], plans) - model.state_scale.centre[0]
        words = "with plans" if plans else "without thrust"
        print(f"surge {words}: {np.sqrt(np.mean(away**2)):.3f} m from its place (RMS)")


if __name__ == "__main__":
    main(*sys.argv[1:])
