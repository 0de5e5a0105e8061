"""ONNX graphs forecast what Python does, at once and step by step."""

import pytest
from numpy.testing import assert_allclose

from seakeep.hosts import write_onnx

onnxruntime = pytest.importorskip("onnxruntime")
pytest.importorskip("onnx")


def session(model, path, **options):
    return onnxruntime.InferenceSession(write_onnx(model, path, **options))


def given(case, x_history, u):
    return {"x_history": x_history} | ({"u": u} if case.model.inputs else {})


@pytest.mark.parametrize(
    "name", ["full", "short", "arx", "autonomous", "following", "following_now"]
)
def test_a_horizon_is_that_of_forecast_arrays(name, cases, tmp_path):
    case = cases[name]
    graph = session(case.model, tmp_path / "m.onnx", steps=len(case.expected))
    found, _ = graph.run(None, given(case, case.x_history, case.u))
    # The same sums in another order, of numbers of the order of ten.
    assert_allclose(found, case.expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["full", "short", "following"])
def test_steps_one_after_the_other_are_the_horizon(name, cases, tmp_path):
    case = cases[name]
    graph, history = session(case.model, tmp_path / "m.onnx"), case.x_history
    for step, expected in enumerate(case.expected):
        found, history = graph.run(None, given(case, history, case.u[step : step + case.rows + 1]))
        assert_allclose(found, expected[None], rtol=1e-12, atol=1e-12)
