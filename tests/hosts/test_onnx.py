"""ONNX graphs forecast what Python does, at once and step by step."""

import numpy as np
import pytest

from seakeep import RequestError
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
    np.testing.assert_allclose(found, case.expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["full", "short", "following"])
def test_steps_one_after_the_other_are_the_horizon(name, cases, tmp_path):
    case = cases[name]
    graph, history = session(case.model, tmp_path / "m.onnx"), case.x_history
    for step, expected in enumerate(case.expected):
        u = case.u[step : step + case.rows + 1]
        found, history = graph.run(None, given(case, history, u))
        np.testing.assert_allclose(found, expected[None], rtol=1e-12, atol=1e-12)


def test_the_graph_names_its_channels(cases, tmp_path):
    graph = session(cases["full"].model, tmp_path / "m.onnx", steps=3)
    assert [(each.name, each.shape) for each in graph.get_outputs()] == [
        ("x", [3, 2]),
        ("x_after", [4, 2]),
    ]
    told = graph.get_modelmeta().custom_metadata_map
    assert told["inputs"] == "eta, wave probe"
    assert float(told["dt"]) == cases["full"].model.dt


def test_a_file_that_seakeep_did_not_write_stays(cases, tmp_path):
    (tmp_path / "m.onnx").write_bytes(b"weights of somebody")
    with pytest.raises(RequestError, match="is not a graph for ONNX that seakeep wrote"):
        write_onnx(cases["arx"].model, tmp_path / "m.onnx")
    (tmp_path / "m.onnx").unlink()
    write_onnx(cases["arx"].model, tmp_path / "m.onnx")
    write_onnx(cases["arx"].model, tmp_path / "m.onnx")
