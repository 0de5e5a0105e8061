"""Mean drift and slow response of a model whose law is known."""

from math import tau

import numpy as np
import xarray as xr
from near import assert_near
from numpy.testing import assert_allclose
from records import record
from scipy import signal
from seas import sea

from seakeep import Expression, HankelDMDc, SlowSquares, check
from seakeep.models.terms import slow_kernel

DT, PERIOD = 0.1, 1.0
GAIN, MEMORY = 0.3, 0.9


def drifting_run(samples=2000, regular=None, **attrs):
    """A surge that remembers, and is pushed by the square of the wave."""
    time = DT * np.arange(samples)
    if regular is None:
        wave = 0.45 * sea(0, (0.7, 1.3), PERIOD, 40).at(time)
    else:
        wave = 0.5 * np.cos(tau * regular * time)
    surge = signal.lfilter([0.0, GAIN], [1.0, -MEMORY], wave**2)
    return record(DT, {"encounter_period": PERIOD, **attrs}, eta=wave, surge=surge)


SQUARE = HankelDMDc(0, 0, 1e-9, delay_rows="exact", observables=(Expression("square", "eta**2"),))
REGULAR = drifting_run(1500, 0.9, waves="regular")


def test_drift_of_a_square_is_its_own():
    model = SQUARE.fit(drifting_run(), ["surge"], ["eta"])
    settled = REGULAR.isel(time=slice(300, None))
    found = check.drift(model, {"sea": drifting_run(), "regular": settled})
    # η² has the mean a²/2, and a²/2 cos Δt of each wave of a pair: G = 0.3 / (e^{iΔ} − 0.9).
    turn = np.exp(1j * tau * found.difference.values * DT)
    law = 0.5 * GAIN / np.abs(turn - MEMORY)
    ours = found.slow_response.sel(state="surge").values
    assert_allclose(ours, np.repeat(law[:, None], ours.shape[1], 1), rtol=1e-4)  # the ridge
    assert_allclose(found.offset[0, 0], law[0], rtol=1e-2)  # windows of whole periods
    assert str(found.units[0].values) == "m/m²"


def test_drift_is_counted_from_the_rest_in_the_wind_of_the_run():
    def blown(run, mean, rest=0.0):
        wind = mean + np.sin(2.0 * np.arange(run.time.size))
        moved = signal.lfilter([0.0, 0.5], [1.0, -MEMORY], wind)
        run = run.assign(wind=run.eta.copy(data=wind), surge=run.surge + moved + rest)
        return run.isel(time=slice(300, None))  # settled

    model = SQUARE.fit(blown(drifting_run(), 4.0), ["surge"], ["eta", "wind"])
    found = check.drift(model, {"regular": blown(REGULAR, 7.0)})
    law = 0.5 * GAIN / (1.0 - MEMORY)
    assert_allclose(found.slow_response.values[0, 0], law, rtol=1e-4)  # the ridge
    assert_allclose(found.offset[0, 0], law, rtol=1e-2)  # windows of whole periods
    assert found.attrs["rest"] == "as the model has it"

    # A surge that rests 0.4 m farther than the model's, in waves and, in another wind, without.
    calm = blown(xr.zeros_like(drifting_run(waves="still")), 2.0, 0.4)
    found = check.drift(model, {"regular": blown(REGULAR, 7.0, 0.4), "calm": calm})
    assert found.attrs["rest"] == "measured in calm"
    # A quarter of a record holds no whole periods of the wind; 0.4 m are 1.6 m per m².
    assert_near(found.offset[0, 0], law, 0.1)
    swings = calm.assign(surge=calm.surge + 1.0 + 5.0 * np.sin(0.3 * calm.time / DT))
    runs = {"regular": blown(REGULAR, 7.0, 0.4), "calm": calm, "decay": swings}
    assert_near(check.drift(model, runs).offset[0, 0], law, 0.1)


def test_drift_is_probed_where_waves_train_alone():
    run = drifting_run()
    run["force"] = run.eta.copy(data=np.sin(tau * 3.0 * run.time.values))
    model = SQUARE.fit(run, ["surge"], ["eta", "force"])
    assert check.drift(model, {"sea": run}).frequency.max() < 1.7


def test_slow_squares_answer_by_their_filter():
    observable = SlowSquares("eta", orders=(0,), cutoff=1 / 3, lags=(0,), lead=1.5)
    spec = HankelDMDc(0, 0, 1e-6, delay_rows="exact", observables=(observable,))
    model = spec.fit(drifting_run(), ["surge"], ["eta"])
    found = check.drift(model, {"sea": drifting_run()}).sel(state="surge")
    mean, slow = found.slow_response.values[0], found.slow_response.values[1:]
    assert np.allclose(mean, mean[0], rtol=1e-3)  # the filter leaves a hundredth of twice the wave
    # A model is a pole and a gain behind the filter of the square.
    kernel = slow_kernel(1 / 30, 15)
    lag = np.arange(-15, 16)
    pole = model.A[0, 0]
    for difference, row in zip(found.difference.values[1:], slow, strict=True):
        turn = tau * difference * DT
        filtered = abs(np.sum(kernel * np.exp(-1j * turn * lag)))
        ratio = filtered * abs((1 - pole) / (np.exp(1j * turn) - pole))
        assert_allclose(row[0] / mean[0], ratio, rtol=1e-2)
