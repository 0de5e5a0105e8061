"""Coherence, and the bound of a linear map, for systems that are known."""

import numpy as np
import pytest
import scipy
import xarray as xr

from seakeep import HankelDMDc, Powers, check
from seakeep.core.spectra import cross_spectra
from seakeep.errors import DataError

RNG = np.random.default_rng


def squared_run(seed=0, samples=12000, part=0.5):
    """Heave answers the wave and, uncorrelated with it, the wave's square."""
    rng = RNG(seed)
    wave = scipy.signal.lfilter([1.0], [1.0, -0.5], rng.standard_normal(samples))
    wave /= wave.std()
    linear = scipy.signal.lfilter([0.0, 1.0, 0.6], [1.0], wave)
    square = np.roll(wave**2 - 1, 1)
    heave = np.sqrt(1 - part**2) * linear / linear.std() + part * square / square.std()
    return xr.Dataset(
        {"eta": ("time", wave, {"units": "m"}), "heave": ("time", heave, {"units": "m"})},
        coords={"time": 0.1 * np.arange(samples)},
        attrs={"encounter_period": 1.0, "waves": "irregular"},
    )


@pytest.fixture(scope="module")
def run():
    return squared_run()


def fitted(run, observables=()):
    spec = HankelDMDc(0, 3, 1e-6, delay_rows="exact", observables=observables)
    return spec.fit(run.isel(time=slice(0, 4000)), ["heave"], ["eta"])


def test_the_bound_of_a_quadratic_vessel_is_its_quadratic_part(run):
    found = check.coherence(fitted(run), {"run": run})
    # A wave that is Gaussian says nothing linear of its square: 0.5 of the SD is left. 75 x 2
    # segments know it to about 3 %.
    assert float(found.linear_bound[0]) == pytest.approx(0.5, abs=0.03)
    assert float(found.nrmse[0]) == pytest.approx(0.5, abs=0.03)
    assert "observables_bound" not in found


def test_observables_lower_the_bound(run):
    found = check.coherence(fitted(run, (Powers("eta", (2,)),)), {"run": run})
    assert float(found.linear_bound[0]) == pytest.approx(0.5, abs=0.03)
    assert float(found.observables_bound[0]) < 0.15  # a lag of a sample in segments of 160
    assert float(found.nrmse[0]) < 0.01


def test_coherence_is_that_of_scipy():
    rng = RNG(1)
    u = rng.standard_normal((4000, 2))
    x = u @ [[1.0, 0.2], [0.5, -1.0]] + rng.standard_normal((4000, 2))
    found = cross_spectra([(u, x)], 0.5, 200)
    known = scipy.signal.coherence(
        u[:, 1] - u[:, 1].mean(), x[:, 0] - x[:, 0].mean(), 2.0, nperseg=200, detrend=False
    )
    assert found.frequency == pytest.approx(known[0])
    assert found.ordinary()[:, 1, 0] == pytest.approx(known[1], abs=1e-12)  # rounding


def test_chance_is_not_counted_as_coherence():
    rng = RNG(2)
    noise = cross_spectra(
        [(rng.standard_normal((2000, 4)), rng.standard_normal((2000, 50)))], 1.0, 100
    )
    # Four inputs explain 4/38 of noise by chance; without the correction the bound were 0.95.
    assert np.mean(noise.unexplained() / noise.outputs) == pytest.approx(1.0, abs=0.01)


def test_circles_of_the_response_cover_as_they_say():
    rng = RNG(3)
    u = rng.standard_normal((2000, 1))
    x = 0.8 * u + rng.standard_normal((2000, 500))
    gain, radius = cross_spectra([(u, x)], 1.0, 100).gain()
    inside = np.abs(gain[10, 0] - 0.8) < radius[10, 0]
    # 500 repetitions know a coverage of 95 % to 1 % (one SD).
    assert 0.92 <= inside.mean() <= 0.98


def test_what_cannot_be_judged_says_why(run):
    model = fitted(run)
    regular = run.assign_attrs(waves="regular")
    with pytest.raises(DataError, match=r"all runs \(a\) are in regular waves.*coherence takes a"):
        check.coherence(model, {"a": regular})
    with pytest.raises(DataError, match=r"has 10 s, and spectra take a segment of 16 s"):
        check.coherence(model, {"a": run.isel(time=slice(0, 100))})
    with pytest.raises(DataError, match=r"independent segments, and coherence with 1 input takes"):
        check.coherence(model, {"a": run.isel(time=slice(0, 200))})
    still = run.assign(eta=run.eta * 0)
    still.eta.attrs = run.eta.attrs
    with pytest.raises(DataError, match=r"the inputs \(eta\) hold no energy"):
        check.coherence(model, {"a": still})
