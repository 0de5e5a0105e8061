"""``seakeep export``: what it writes, what it says, and what it refuses."""

import pytest
from drifting import INPUTS, STATES, drifting_run

import seakeep
from seakeep import HankelDMDc, ProbeAlignment, RequestError, cli
from seakeep.hosts import write_estimator
from seakeep.hosts.program import exportable, timing


@pytest.fixture
def run(cases, tmp_path, monkeypatch, capsys):
    cases["full"].model.save(tmp_path / "my-model.nc")
    monkeypatch.chdir(tmp_path)

    def call(*words):
        status = cli.main(["export", "my-model.nc", *words])
        return status, capsys.readouterr().err

    return call


def test_sources_take_the_name_of_the_model_and_the_instants_are_told(run, tmp_path):
    status, said = run("--c", "library")
    assert status == 0
    assert {path.name for path in (tmp_path / "library").iterdir()} == {"my_model.c", "my_model.h"}
    lead = "A step of 0.1 s takes the inputs 16 samples (1.6 s) after the instant that it starts"
    assert lead in said


def test_a_reduced_order_is_of_the_matrices_alone_and_states_its_error(make_run, tmp_path, capsys):
    HankelDMDc(4, 8, 1.0, stable=True).fit(make_run(), ["heave"], ["eta_fwd"]).save(
        tmp_path / "m.nc"
    )
    words = ["export", str(tmp_path / "m.nc"), "--mat", str(tmp_path / "m.mat"), "--order", "4"]
    assert cli.main(words) == 0
    assert "The system of order 4 errs by" in capsys.readouterr().err
    assert cli.main([*words, "--c", str(tmp_path), "--estimator"]) == 2
    assert "--order reduces the linear system of --mat; an estimator" in capsys.readouterr().err


def test_an_estimator_knows_the_noise_and_the_roles_of_the_command(make_run, tmp_path, capsys):
    model = HankelDMDc(4, 8, 1.0).fit(make_run(), ["heave"], ["eta_fwd"])
    model.save(tmp_path / "m.nc")
    words = ["export", str(tmp_path / "m.nc"), "--c", str(tmp_path / "c")]
    service = ["--estimator", "--noise", "heave=0.25", "--role", "eta_fwd=known"]
    assert cli.main([*words, *service]) == 0
    stated = {"noise": {"heave": 0.25}, "roles": {"eta_fwd": "known"}}
    for path in write_estimator(model, tmp_path / "python", "m", **stated):
        assert path.read_text() == (tmp_path / "c" / path.name).read_text()
    capsys.readouterr()
    for wrong, message in (
        (service[1:], "--noise and --role belong to --estimator"),
        ([*service[:2], "heave"], "--noise takes STATE=SD, such as heave=0.002"),
        ([*service, "--role", "eta_fwd"], "received heave=0.25, eta_fwd=known, eta_fwd."),
        ([*service, "--role", "eta_fwd=plan"], "role of eta_fwd"),
    ):
        assert cli.main([*words, *wrong]) == 2
        assert message in capsys.readouterr().err


def test_an_ensemble_is_no_estimator_nor_is_a_member(make_run, tmp_path, capsys):
    ensemble = seakeep.BayesianHankelDMDc(
        window=None, state_delays=2, input_delays=4, ridge=seakeep.Uniform(1, 2), n_members=2
    ).fit(make_run(), ["heave"], ["eta_fwd"])
    ensemble.save(tmp_path / "m.nc")
    words = ["export", str(tmp_path / "m.nc"), "--c", str(tmp_path), "--estimator"]
    for more in ((), ("--member", "0")):
        assert cli.main([*words, *more]) == 2
        assert "Fit a single model of the same runs" in capsys.readouterr().err


def test_waves_that_no_host_can_carry_are_refused_with_the_way_out(make_run, channels):
    alignment = ProbeAlignment(surge="none", celerity=2.0, offset=0.5)
    model = HankelDMDc(2, 2, 1.0, alignment=alignment).fit(make_run(), **channels)
    with pytest.raises(RequestError, match=r"carried over whole records, .* surge = 'predicted'"):
        exportable(model)
    measured = ProbeAlignment(mode="dispersion", surge="measured")
    model = HankelDMDc(2, 2, 1.0, alignment=measured).fit(drifting_run(), STATES, INPUTS)
    with pytest.raises(RequestError, match="to the measured surge, which no step can make"):
        exportable(model)
    followed = ProbeAlignment(mode="dispersion", surge="predicted")
    spec = HankelDMDc(2, 2, 1.0, delay_rows="exact", alignment=followed)
    model = spec.fit(drifting_run(), STATES, INPUTS)
    assert "the probes as measured, where they stood in training" in timing(exportable(model))
    with pytest.raises(RequestError, match="its own surge takes it, which no linear system"):
        model.to_state_space()


def test_an_fmu_without_a_compiler_is_announced(run, monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    status, said = run("--fmu", "rom.fmu")
    assert status == 0
    assert "rom.fmu holds sources alone: no C compiler was found" in said
