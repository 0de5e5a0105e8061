"""The C of a model computes what Python does, in one program with the C of other models."""

import ctypes
import shutil
import subprocess
from dataclasses import replace

import compiled
import numpy as np
import pytest
from compiled import pointer
from numpy.testing import assert_allclose, assert_array_equal
from oscillators import growing_model

from seakeep import HankelDMDc, ProbeAlignment
from seakeep.hosts import write_c, write_estimator
from seakeep.hosts.c import identifier

NAMES = ["full", "short", "arx", "autonomous", "unstable", "following", "following_now"]
FINITE, REFUSED, LOST = 0, 1, 2


class Host:
    """A program that runs a model; its struct begins with the states."""

    def __init__(self, library, name, states):
        self.start, self.step = (getattr(library, f"{name}_{verb}") for verb in ("start", "step"))
        self.memory = (ctypes.c_double * 2000)()  # more than any struct of these tests
        self.states = states

    @property
    def x(self):
        return np.array(self.memory[: self.states])


def written(models, folder):
    for name, model in models.items():
        write_c(model, folder, name)
    return compiled.library(folder)


@pytest.fixture(scope="module")
def library(cases, tmp_path_factory):
    return written({name: cases[name].model for name in NAMES}, tmp_path_factory.mktemp("library"))


@pytest.fixture
def host(library, cases):
    def started(name):
        case = cases[name]
        made = Host(library, name, len(case.model.states))
        history = pointer(case.x_history), pointer(case.u[: case.rows])
        assert made.start(made.memory, *history) == FINITE
        return made

    return started


@pytest.mark.parametrize("name", NAMES)
def test_each_step_is_that_of_forecast_arrays(name, host, cases):
    case, run = cases[name], host(name)
    assert_array_equal(run.x, case.x_history[-1])
    for row, expected in zip(case.u[case.rows :], case.expected, strict=True):
        assert run.step(run.memory, pointer(row)) == (LOST if np.isnan(expected).any() else FINITE)
        # The same sums in another order, of numbers of the order of ten.
        assert_allclose(run.x, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["full", "short", "following"])
def test_the_derivative_of_a_step_is_that_of_the_jacobian(name, host, library, cases):
    case, run = cases[name], host(name)
    _, on_inputs = case.model.jacobian(case.x_history, case.u[: case.rows + 1])
    change, found = np.array([0.3, -0.7]), np.empty(len(case.model.states))
    given = pointer(case.u[case.rows]), pointer(change)
    getattr(library, f"{name}_derivative")(run.memory, *given, pointer(found))
    # Differences of numbers of the order of ten over 1e-3, which cubes of waves bend by 1e-6.
    assert_allclose(found, on_inputs[:, -1] @ change, rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_an_input_that_is_not_finite_leaves_the_model_as_it_was(bad, host):
    run = host("full")
    before = bytes(run.memory)
    assert run.step(run.memory, pointer([0.1, bad])) == REFUSED
    assert bytes(run.memory) == before


def test_a_start_from_what_is_not_finite_is_refused(library, cases):
    case = cases["short"]
    run = Host(library, "short", 2)
    gap = case.x_history.copy()
    gap[0, 1] = np.nan
    assert run.start(run.memory, pointer(gap), pointer(case.u[: case.rows])) == REFUSED
    assert not any(run.memory)


def test_a_spike_of_a_probe_is_forgotten_by_the_limit_in_c_and_python(tmp_path, make_run):
    """A state grows by itself, and a spike a hundred times as high as training is before it."""
    model = growing_model(make_run(), 1.001)
    (mean,), (reach,) = model.state_scale.centre, model.state_scale.reach
    steps, u = 6000, np.full((6000, 1), model.input_scale.centre)
    u[3] += 100 * model.input_scale.reach
    start = np.array([[mean + reach]])
    expected = model.forecast_arrays(start, u[:1], u[1:], steps)
    since = np.arange(steps)
    limit = 10 * (1 + 99 * (since >= 3) * (1 - 1 / (20 * 64)) ** (since - 3))
    last = int(np.argmax(1.001 ** (since + 1) > limit))
    assert 3500 < last < 4500  # 6910 where the spike is never forgotten
    assert int(np.argmax(np.isnan(expected[:, 0]))) == last
    run = Host(written({"rom": model}, tmp_path), "rom", 1)
    assert run.start(run.memory, pointer(start), pointer(u[:0])) == FINITE
    assert [run.step(run.memory, pointer(row)) for row in u[: last + 1]] == [FINITE] * last + [LOST]


@pytest.mark.parametrize(
    ("file", "name"), {"my model-2": "my_model_2", "3d": "m_3d", "η": "m__"}.items()
)
def test_a_file_name_becomes_an_identifier(file, name):
    assert identifier(file) == name


def test_an_alignment_that_was_left_out_leaves_nothing_to_be_carried(tmp_path, make_run, channels):
    optional = ProbeAlignment(mode="dispersion", surge="predicted", optional=True)
    spec = HankelDMDc(2, 2, 1.0, delay_rows="exact", lead=2)
    made, plain = (
        write_c(replace(spec, alignment=each).fit(make_run(), **channels), tmp_path / str(number))
        for number, each in enumerate((optional, None))  # the runs state no depth
    )
    assert [path.read_text() for path in made] == [path.read_text() for path in plain]


def test_a_header_is_cxx11_and_its_step_is_exact(cases, tmp_path):
    if shutil.which("c++") is None:
        pytest.skip("there is no C++ compiler")
    model = cases["full"].model
    write_estimator(model, tmp_path)
    same = f'#include "rom_estimator.h"\nstatic_assert(ROM_STEP == {model.dt!r}, "the step");\n'
    (tmp_path / "host.cpp").write_text(same)
    flags = ["-std=c++11", "-pedantic", "-Wall", "-Werror", "-fsyntax-only"]
    subprocess.run(["c++", *flags, "host.cpp"], cwd=tmp_path, check=True)
