"""MATLAB files of models with observables, played by scipy as their entry Regressors says."""

import re

import numpy as np
import pytest
from scipy import io, signal

FUNCTIONS = {"sqrt": np.sqrt, "sin": np.sin, "cos": np.cos, "abs": np.abs}


def filtered(content, name, values):
    """Output of a filter of the file, from rest."""
    a, b, c, d = (content[f"{name}{part}"] for part in "ABCD")
    system = (a.toarray(), b.toarray(), c, d, content["Ts"].item())
    return signal.dlsim(system, values)[1]


def evaluated(text, p):
    """Value of a function of MATLAB for each row of p."""
    body = re.sub(
        r"p\((\d+)\)", lambda found: f"p[:, {int(found[1]) - 1}]", text.replace("^", "**")
    )
    rows = body.removeprefix("@(p) [").removesuffix("]").split("; ")
    return np.stack([eval(row, FUNCTIONS | {"p": p}) for row in rows], axis=1)


@pytest.mark.filterwarnings("ignore:.*spmatrix")  # older scipy does not take the argument
@pytest.mark.parametrize("name", ["full", "arx"])
def test_a_mat_file_with_observables_computes_the_forecast(cases, tmp_path, name):
    case = cases[name]
    content = io.loadmat(case.model.to_mat(tmp_path / "rom.mat"))
    assert content["Lead"].item() == case.model.lead_samples
    inputs = [str(each[0]) for each in content["InputName"][:, 0]]
    assert inputs == case.model.regressors
    assert ("Function" in content) == (name == "full")
    r, z, lead = case.u, case.model.input_delays, content["Lead"].item()
    if name == "full":
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
