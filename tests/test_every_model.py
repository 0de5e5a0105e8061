"""Every kind of model by every preset, and one with an alignment: the same after a file."""

import tomllib
import zipfile
from functools import cache

import numpy as np
import pytest
import tomlkit
import two_loggers
import xarray as xr
from tutorial_study import put_tutorial

from seakeep import SeakeepError, load_model, read_campaign
from seakeep.campaign import load_prepared, write_prepared
from seakeep.check import check_model
from seakeep.hosts import write_c, write_fmu, write_onnx
from seakeep.models import KINDS, load_live
from seakeep.study import compare, comparison_table, fit_campaign

STEPS = 12
MADE = [(kind, each) for kind, spec in KINDS.items()
        for each in ("paper", "recommended", "") if not each or hasattr(spec, each)
        if each or not hasattr(spec, "recommended")]  # fmt: skip
"""Kinds by their presets, or without one where there is none."""
FEWER = {"bayesian_hankel_dmdc": {"n_members": 3}, "subspace": {"order": 8}}
"""What two states and a short run allow."""
PUT = {"tutorial": put_tutorial, "two loggers": two_loggers.write}
"""Campaigns that are put into a folder; waves of the second are aligned."""


@pytest.fixture(scope="module")
def campaign_of(tmp_path_factory):
    """Campaign of a set of data, prepared, with a table of each kind and preset."""

    @cache
    def made(name):
        folder = tmp_path_factory.mktemp("data")
        PUT[name](folder)
        table = tomllib.loads((folder / "campaign.toml").read_text("utf-8"))
        channels = {key: table["model"][key] for key in ("states", "inputs")}
        models = table["models"] = {"own": table["model"]}
        for kind, preset in MADE:
            models[f"{kind}{preset}"] = {"kind": kind} | channels
            if preset:
                models[f"{kind}{preset}"]["preset"] = preset
            models[f"{kind}{preset}"] |= FEWER.get(kind, {})
        (folder / "campaign.toml").write_text(tomlkit.dumps(table), "utf-8")
        campaign = read_campaign(folder / "campaign.toml")
        write_prepared(campaign)
        return campaign

    return made


def answer(call):
    """What a call gives, or the words of its refusal."""
    try:
        return call()
    except SeakeepError as error:
        return str(error)


def answers(model, campaign, runs, folder):
    """All that a model says and does, by a word for each."""
    test = campaign.test_runs[0]
    compared = compare(model, campaign, [test], steps=STEPS)
    folder.mkdir()
    out = {
        "file": model.save(folder / "model.nc").read_bytes(),
        "summary": model.summary(),
        "forecast": compared[0].forecast,
        "compared": comparison_table(compared),
        "C": answer(lambda: [each.read_text() for each in write_c(model, folder / "c")]),
        "FMU": answer(lambda: unpacked(write_fmu(model, folder / "model.fmu"))),
        "ONNX": answer(lambda: write_onnx(model, folder / "model.onnx").read_bytes()),
    }
    if model.kind == "hankel_dmdc":  # which all kinds are checked as, in seconds
        checked = check_model(model, {test: runs[test]})
        out |= {"refused": checked.refused, **checked.results}
    served = model.hold() if hasattr(model, "hold") else model
    if hasattr(served, "live"):
        out["live"] = answer(lambda: follow(served, runs[test], folder / "live.nc"))
    return out


def unpacked(path):
    """Files of an archive by their names."""
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def follow(model, run, path):
    """Estimates of a model in service, one half before and one after a restart from its file."""
    live, found = model.live(like=run), []
    for k in range(40):
        if k == 20:
            live = load_live(model, live.save(path))
        inputs, states = (
            {name: run[name].values[k] for name in names} for names in (model.inputs, model.states)
        )
        found.append(live.step(inputs, states))
    return np.array(found)


@pytest.mark.filterwarnings("ignore::seakeep.errors.SeakeepWarning")
@pytest.mark.parametrize(
    ("name", "kind", "preset"),
    [
        *(("tutorial", *each) for each in MADE),
        ("two loggers", "own", ""),
    ],
)
def test_a_model_is_the_same_after_its_file(campaign_of, tmp_path, monkeypatch, name, kind, preset):
    campaign = campaign_of(name)
    monkeypatch.setenv("PATH", "")  # FMUs hold sources alone: no compiler is found
    monkeypatch.delenv("CC", raising=False)
    runs = load_prepared(campaign)
    model = fit_campaign(campaign, f"{kind}{preset}")
    if KINDS[model.kind].is_ensemble:
        model = model.calibrate([runs[each] for each in campaign.test_runs], STEPS, level=0.5)
    loaded = load_model(model.save(tmp_path / "model.nc"))
    before = answers(model, campaign, runs, tmp_path / "before")
    after = answers(loaded, campaign, runs, tmp_path / "after")
    assert list(after) == list(before)
    for word, found in after.items():
        if isinstance(found, xr.Dataset):
            xr.testing.assert_identical(found, before[word])
        elif isinstance(found, np.ndarray):
            np.testing.assert_array_equal(found, before[word])
        else:
            assert found == before[word]
