"""MATLAB files of models with observables, played by scipy as their entry Regressors says."""

import re

import numpy as np
import pytest
from oscillators import growing_model
from said import request_error
from scipy import io, signal

from seakeep import HankelDMDc

FUNCTIONS = {"sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "abs": np.abs}


def filtered(content, name, values):
    """Output of a filter of the file, from rest."""
    a, b, c, d = (content[f"{name}{part}"] for part in "ABCD")
    if not a.shape[0]:  # of the newest sample alone
        return values @ d.T
    return signal.dlsim((a.toarray(), b.toarray(), c, d, content["Ts"].item()), values)[1]


def evaluated(text, p):
    """Value of a function of MATLAB for each row of p."""
    body = re.sub(
        r"p\((\d+)\)", lambda found: f"p[:, {int(found[1]) - 1}]", text.replace("^", "**")
    )
    rows = body.removeprefix("@(p) [").removesuffix("]").split("; ")
    return np.stack([eval(row, FUNCTIONS | {"p": p}) for row in rows], axis=1)


@pytest.mark.filterwarnings("ignore:.*spmatrix")  # older scipy does not take the argument
@pytest.mark.parametrize("name", ["full", "powers", "arx"])
def test_a_mat_file_with_observables_computes_the_forecast(cases, tmp_path, name):
    case = cases[name]
    content = io.loadmat(case.model.to_mat(tmp_path / "rom.mat"))
    assert content["Lead"].item() == case.model.lead_samples
    assert [each[0] for each in content["InputName"][:, 0]] == case.model.regressors
    assert ("Function" in content) == (name != "arx")
    r, z, lead = case.u, case.model.input_delays, content["Lead"].item()
    if name != "arx":
        with request_error("driven by observables too"):
            case.model.to_state_space()
        n = content["Delayed"].item()
        q = evaluated(content["Function"].item(), filtered(content, "Filter", r))
        c, top = filtered(content, "Slow", q[:, n:]), content["Top"][:, 0]
        c = np.minimum(c, top) + content["Slope"][:, 0] * np.maximum(c - top, 0.0)
        r = np.concatenate([q[:, :n], c], axis=1)
        assert r.shape[1] == len(case.model.regressors)
    r = r[lead:] - content["InputOffset"][:, 0]  # a row of the instant k from the input of k + Lead
    start, n = len(r) - len(case.expected), len(case.model.signature.input_scale.mean)
    x = (case.x_history - content["OutputOffset"][:, 0])[: -case.model.state_delays - 2 : -1]
    state = np.concatenate([x.ravel(), r[start - z : start, :n][::-1].ravel()])
    found = []
    for row in r[start:]:
        state = content["A"] @ state + content["B"] @ row
        found.append(content["C"] @ state + content["OutputOffset"][:, 0])
    # Rounding, of values up to some hundreds.
    np.testing.assert_allclose(found, case.expected, rtol=1e-12, atol=1e-11)


def test_the_error_of_a_truncated_system_stays_below_its_bound(make_run, tmp_path):
    runs = [make_run(1200, seed) for seed in (1, 2)]
    model = HankelDMDc(4, 8, 1.0, stable=True).fit(runs, ["heave", "pitch"], ["eta_fwd"])
    whole, small = (
        io.loadmat(model.to_mat(tmp_path / f"{order}.mat", order)) for order in (None, 6)
    )
    assert small["A"].shape == (6, 6)
    spreads = model.state_scale.spread[:, None] / model.signature.input_scale.spread
    errors = []
    for omega in np.linspace(0, np.pi, 400):
        gains = [
            m["C"] @ np.linalg.solve(np.exp(1j * omega) * np.eye(len(m["A"])) - m["A"], m["B"])
            for m in (whole, small)
        ]
        errors.append(np.linalg.norm((gains[1] - gains[0]) / spreads, 2))
    bound = small["ErrorBound"].item()
    # At least the first singular value that is left out, at most twice the sum of all.
    assert 0.05 * bound < max(errors) <= bound
    np.testing.assert_allclose(
        small["ErrorPeak"].item(), max(errors), rtol=1e-9
    )  # the same frequencies
    with request_error("order is 99; it must lie between 1 and"):
        model.to_mat(tmp_path / "more.mat", 99)


def test_a_system_that_grows_is_not_truncated(make_run, tmp_path):
    model = growing_model(make_run(), 1.001, delays=1)
    with request_error(r"modulus 1\.001, and balanced truncation takes"):
        model.to_mat(tmp_path / "rom.mat", 1)
