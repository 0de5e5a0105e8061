"""``seakeep export``: what it writes, what it says, and what it refuses."""

from zipfile import ZipFile

import pytest
from drifting import INPUTS, STATES, drifting_run
from ensembles import few
from said import request_error
from scipy.io import loadmat

from seakeep import HankelDMDc, ProbeAlignment
from seakeep.hosts import write_estimator
from seakeep.hosts.program import exportable, timing


@pytest.fixture
def run(tmp_path, monkeypatch, command):
    """Save a model, export it, and tell what the command said."""
    monkeypatch.chdir(tmp_path)

    def call(model, words, status=0):
        model.save("my-model.nc")
        return command("export", "my-model.nc", *words.split(), status=status)[1]

    return call


def heave_model(make_run, **settings):
    return HankelDMDc(4, 8, 1.0, **settings).fit(make_run(), ["heave"], ["eta_fwd"])


def test_sources_take_the_name_of_the_model_and_the_instants_are_told(run, cases, tmp_path):
    said = run(cases["full"].model, "--c library")
    assert {path.name for path in (tmp_path / "library").iterdir()} == {"my_model.c", "my_model.h"}
    lead = "A step of 0.1 s takes the inputs 16 samples (1.6 s) after the instant that it starts"
    assert lead in said


def test_a_reduced_order_is_of_the_matrices_alone_and_states_its_error(make_run, run, tmp_path):
    model, words = heave_model(make_run, stable=True), "--mat m.mat --order 4"
    content = loadmat(model.to_mat(tmp_path / "same.mat", 4))
    peak, bound = (content[f"Error{each}"].item() for each in ("Peak", "Bound"))
    said = run(model, words)
    assert f"The system of order 4 errs by {peak:.3g} SD of its outputs" in said
    assert f"and by {bound:.3g} at most at any." in said
    said = run(model, f"{words} --c . --estimator", 2)
    assert "--order reduces the linear system of --mat; an estimator" in said


def test_an_estimator_knows_the_noise_and_the_roles_of_the_command(make_run, run, tmp_path):
    model, noise = heave_model(make_run), "--c c --noise heave=0.25"
    service = f"{noise} --estimator --role eta_fwd=known"
    run(model, service)
    stated = {"noise": {"heave": 0.25}, "roles": {"eta_fwd": "known"}}
    for path in write_estimator(model, tmp_path / "python", "my_model", **stated):
        assert path.read_text() == (tmp_path / "c" / path.name).read_text()
    for wrong, message in {
        noise: "--noise and --role belong to --estimator",
        "--c c --estimator --noise heave": "--noise takes STATE=SD, such as heave=0.002",
        f"{service} --role eta_fwd": "received heave=0.25, eta_fwd=known, eta_fwd.",
        f"{service} --role eta_fwd=plan": "role of eta_fwd",
    }.items():
        assert message in run(model, wrong, 2)


def test_an_ensemble_is_no_estimator_nor_is_a_member(make_run, run):
    ensemble = few().fit(make_run(), ["heave"], ["eta_fwd"])
    for more in ("", " --member 0"):
        assert "Fit a single model of the same runs" in run(ensemble, f"--c . --estimator{more}", 2)


def test_waves_that_no_host_can_carry_are_refused_with_the_way_out(cases):
    for words, alignment in {
        "carried over whole records, .* surge = 'predicted'": {"surge": "none", "celerity": 2.0},
        "to the measured surge, which no step can make": {"surge": "measured"},
    }.items():
        spec = HankelDMDc(2, 2, 1.0, alignment=ProbeAlignment(offset=0.5, **alignment))
        model = spec.fit(drifting_run(), STATES, INPUTS)
        with request_error(words):
            exportable(model)
    model = cases["following"].model
    assert "the probes as measured, where they stood in training" in timing(exportable(model))
    with request_error("its own surge takes it, which no linear system"):
        model.to_state_space()


def test_an_fmu_without_a_compiler_is_announced(run, cases, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    said = run(cases["full"].model, "--fmu rom.fmu")
    assert "rom.fmu holds sources alone: no C compiler was found" in said
    listed = ["modelDescription.xml", "sources/rom.h", "sources/rom.c", "sources/fmi2.c"]
    assert ZipFile(tmp_path / "rom.fmu").namelist() == listed
