"""An FMU validates, runs as Python does, and goes on from a state in another process."""

import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from records import table
from said import request_error

from seakeep import HankelDMDc
from seakeep.hosts import write_fmu
from seakeep.hosts.c import compiler
from seakeep.models.validity import Validity

fmpy = pytest.importorskip("fmpy")
if compiler() is None:
    pytest.skip("there is no C compiler", allow_module_level=True)
from fmpy.fmi2 import FMU2Slave  # noqa: E402
from fmpy.validation import validate_fmu  # noqa: E402


@pytest.fixture(scope="module")
def fmu(cases, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CC", "cc -Wall -Wextra -Wno-unused-parameter -Werror")
        return write_fmu(cases["full"].model, tmp_path_factory.mktemp("fmu") / "rom.fmu")


@pytest.fixture(scope="module")
def unpacked(fmu, tmp_path_factory):
    return fmpy.extract(fmu, tmp_path_factory.mktemp("unpacked"))


@pytest.fixture
def slave(fmu, unpacked, cases):
    """The FMU past its initialization."""
    description = fmpy.read_model_description(fmu)
    made = FMU2Slave(
        guid=description.guid,
        unzipDirectory=str(unpacked),
        modelIdentifier="rom",
        instanceName="vessel",
    )
    made.instantiate()
    made.setupExperiment(startTime=0.0)
    made.enterInitializationMode()
    references = {each.name: each.valueReference for each in description.modelVariables}
    case, names = cases["full"], {"wave probe": "'wave probe'"}
    for labels, history in (
        (case.model.states, case.x_history),
        (case.model.inputs, case.u[: case.rows]),
    ):
        for label, series in zip(labels, history.T, strict=True):  # the oldest sample first
            name = names.get(label, label)
            rows = [references[f"history.{name}[{row + 1}]"] for row in range(len(series))]
            made.setReal(rows, list(series))
    made.exitInitializationMode()
    yield made
    made.freeInstance()


def run(slave, case, first, stop):
    """States after the steps from `first` to before `stop`."""
    dt, found = case.model.dt, []
    for step in range(first, stop):
        slave.setReal([0, 1], list(case.u[case.rows + step]))
        slave.doStep(step * dt, dt)
        found.append(slave.getReal([2, 3]))
    return np.array(found)


OTHER_PROCESS = """
import sys
import numpy as np
from fmpy.fmi2 import FMU2Slave

folder, guid, state, inputs, dt = sys.argv[1:]
slave = FMU2Slave(guid=guid, unzipDirectory=folder, modelIdentifier="rom", instanceName="other")
slave.instantiate()
slave.setupExperiment(startTime=0.0)
slave.enterInitializationMode()
slave.exitInitializationMode()
slave.setFMUstate(slave.deSerializeFMUstate(open(state, "rb").read()))
for number, u in enumerate(np.load(inputs)):
    slave.setReal([0, 1], list(u))
    slave.doStep(number * float(dt), float(dt))
    print(*(value.hex() for value in slave.getReal([2, 3])))
"""


def test_another_process_goes_on_from_a_state_to_the_last_bit(slave, unpacked, cases, tmp_path):
    case = cases["full"]
    assert_array_equal(slave.getReal([2, 3]), case.x_history[-1])
    begun = run(slave, case, 0, 20)
    state = slave.getFMUstate()
    (tmp_path / "state").write_bytes(slave.serializeFMUstate(state))
    np.save(tmp_path / "inputs.npy", case.u[case.rows + 20 :])
    expected = run(slave, case, 20, len(case.expected))
    assert_allclose([*begun, *expected], case.expected, rtol=1e-12, atol=1e-12)
    slave.setFMUstate(state)
    assert_array_equal(run(slave, case, 20, len(case.expected)), expected)
    slave.freeFMUstate(state)
    given = [unpacked, slave.guid, tmp_path / "state", tmp_path / "inputs.npy", case.model.dt]
    done = subprocess.run(
        [sys.executable, "-c", OTHER_PROCESS, *map(str, given)],
        capture_output=True,
        text=True,
        check=True,
    )
    found = [[float.fromhex(word) for word in line.split()] for line in done.stdout.splitlines()]
    assert_array_equal(found, expected)


def test_a_step_that_does_not_follow_on_the_last_is_refused(slave, cases):
    case = cases["full"]
    run(slave, case, 0, 3)
    for start, step in ((2, 1.0), (4, 1.0), (3, 1.001)):
        with pytest.raises(Exception, match="fmi2DoStep failed with status 3"):
            slave.doStep(start * case.model.dt, step * case.model.dt)
    found = run(slave, case, 3, len(case.expected))
    assert_allclose(found, case.expected[3:], rtol=1e-12, atol=1e-12)


def test_directional_derivatives_are_those_of_the_jacobian(slave, cases):
    case = cases["full"]
    _, on_inputs = case.model.jacobian(case.x_history, case.u[: case.rows + 1])
    slave.setReal([0, 1], list(case.u[case.rows]))
    found = slave.getDirectionalDerivative([3, 2], [1], [2.0])
    # Cubes of waves bend the differences.
    assert_allclose(found, 2.0 * on_inputs[::-1, -1, 1], rtol=1e-5)
    for unknown, known in ((0, 1), (2, 2)):
        with pytest.raises(Exception, match="fmi2GetDirectionalDerivative failed with status 3"):
            slave.getDirectionalDerivative([unknown], [known], [1.0])


@pytest.mark.parametrize("wave", ["eta", 'wave <1> & "2"', "c\\d'e", "η */ x"])
def test_any_name_of_a_channel_is_sound(wave, make_run, channels, tmp_path, monkeypatch):
    run = make_run().rename(eta_fwd=wave)
    run[wave].attrs |= {"units": "<m> 'µ'", "long_name": f"wave, {wave}"}
    model = HankelDMDc(0, 0, 1.0).fit(run, channels["states"], [wave, "eta_cog"])
    monkeypatch.setenv("PATH", str(tmp_path))  # names are not a matter of the binary
    fmu = write_fmu(model, tmp_path / "rom.fmu")
    assert validate_fmu(str(fmu)) == []
    assert fmpy.read_model_description(fmu).modelVariables[0].unit == "<m> 'µ'"


def test_a_compiler_that_fails_is_quoted(cases, tmp_path, monkeypatch):
    monkeypatch.setenv("CC", f"{sys.executable} -c 'raise SystemExit(\"no licence\")'")
    with request_error(r"the C compiler failed: (.|\n)*no licence(.|\n)*CC"):
        write_fmu(cases["arx"].model, tmp_path / "arx.fmu")
    assert not (tmp_path / "arx.fmu").exists()


@pytest.mark.usefixtures("errors_of_training")
def test_a_unit_that_follows_estimates_and_forecasts_as_the_live_model_with_samples_lost(
    cases, tmp_path
):
    model = cases["full"].model
    unit = write_fmu(model, tmp_path / "follow.fmu", ahead=3)
    assert validate_fmu(str(unit)) == []
    rng, dt, count = np.random.default_rng(0), model.dt, 120
    u, y = (0.1 * rng.standard_normal((count, size)) for size in (2, 2))
    for each in (u, y):  # a tenth is lost
        each[rng.random(each.shape) < 0.1] = np.nan
    names = ["time", "eta", "'wave probe'", *(f"measured.{state}" for state in model.states)]
    rows = [(at * dt, *u[at], *y[at]) for at in range(count)]
    coming = [f"{k}.{x}[{n}]" for k in ("ahead", "std") for n in (1, 2, 3) for x in model.states]
    result = fmpy.simulate_fmu(
        str(unit),
        stop_time=count * dt,
        input=np.array(rows, dtype=[(name, float) for name in names]),
        output=[*model.states, *coming, "model.validity"],
    )
    live = model.live()
    expected = [live.step(*row) for row in zip(u, y, strict=True)]
    assert_allclose(result[model.states].tolist()[1:], expected, rtol=1e-10, atol=1e-10)
    expected = table(live.forecast(3), model.states)[:2].ravel()
    assert_allclose([result[name][-1] for name in coming], expected, rtol=1e-6)
    flags = result["model.validity"].astype(int)
    assert flags[-1] | Validity.CONSISTENCY == live.validity | Validity.CONSISTENCY
    assert flags[0] == Validity(0) != live.validity & Validity.LOST
