"""What the presets choose, row by row of the paper map, through each door that takes one."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest

from seakeep import Uniform
from seakeep.campaign import ModelSettings, read_campaign
from seakeep.campaign.settings import is_elevation
from seakeep.signals.waves import paper_welch
from seakeep.study import judge, read_study
from seakeep.study.reproduce import ACTS, Size, study_text
from seakeep.study.resolve import can_align, resolve_model

pytest.importorskip("numba", reason="the campaign is the virtual tank's")

PERIOD, DT = 1.64, 1.64 / 32
MAP = (Path(__file__).parents[2] / "docs/paper_map.md").read_text(encoding="utf-8")
ROWS = {
    int(cells[1]): (cells[3].strip(), cells[4].strip())
    for line in MAP.splitlines()
    if (cells := line.split("|"))[1:] and re.fullmatch(r" \d+ ", cells[1])
}
OF_JUDGEMENT = {16, 19, 21, 22, 25, 26}
"""Rows that say how forecasts are judged: a study's, and none of `fit`'s."""
OF_TRAINING = {3}
"""Which waves are played, and which part of them trains: the campaign's for `fit`."""


@pytest.fixture
def tank(tmp_path):
    """The virtual tank's campaign file, without its raw files."""
    from seakeep.tank.delivery import campaign_text
    from seakeep.tank.settings import default_settings

    settings = default_settings()
    files = {run: {"wave_probes": f"{run}.csv"} for run in settings.runs}
    text = campaign_text(settings, files, "csv", one_logger=False)
    (tmp_path / "campaign").mkdir()
    (tmp_path / "campaign/campaign.toml").write_text(text, encoding="utf-8")
    return tmp_path


def with_preset(folder, preset):
    """The campaign with that preset of the model, and none of the preparation."""
    path = folder / "campaign/campaign.toml"
    text = path.read_text(encoding="utf-8")
    model = re.sub(r'(\[model\][^[]*?)preset = "\w+"', rf'\1preset = "{preset}"', text)
    path.write_text(re.sub(r'(\[preparation\]\n)preset = "\w+"\n', r"\1", model), encoding="utf-8")
    return path


def through_fit(folder, preset):
    campaign = read_campaign(with_preset(folder, preset))
    single = campaign.model()
    several = ModelSettings(
        kind="bayesian_hankel_dmdc", preset=preset, states=single.states, inputs=single.inputs
    )
    aligned = can_align(campaign.settings, single.inputs)
    specs = [resolve_model(each, PERIOD, DT, aligned=aligned).spec for each in (single, several)]
    return SimpleNamespace(campaign=campaign, specs=specs, study=None)


def of_study(path):
    study = read_study(path)
    settings = study.settings
    aligned = can_align(study.campaign.settings, study.inputs)
    specs = [
        resolve_model(each, PERIOD, DT, preset=settings.study.preset, aligned=aligned).spec
        for each in list(settings.models.values())[:2]
    ]
    return SimpleNamespace(campaign=study.campaign, specs=specs, study=settings)


def through_study(folder, preset):
    with_preset(folder, {"paper": "recommended", "recommended": "paper"}[preset])
    path = folder / "study.toml"
    path.write_text(
        f'[study]\ncampaign = "campaign/campaign.toml"\npreset = "{preset}"\n', encoding="utf-8"
    )
    return of_study(path)


def through_reproduce(folder, preset):
    act = next(act for act in ACTS if act.preset == preset and not act.without_drift)
    path = folder / act.name / "study.toml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(study_text(act, Size(), 0), encoding="utf-8")
    return of_study(path)


DOORS = {"fit": through_fit, "study": through_study, "reproduce": through_reproduce}


def paper(found):
    """Rows that the paper's column decides otherwise than ours, and whether the door takes it."""
    single, ensemble = found.specs
    preparation, study = found.campaign.settings.preparation, found.study
    out = {
        5: all(each.alignment.mode == "effective" for each in found.specs),
        6: all(each.alignment.surge == "measured" for each in found.specs),
        9: single.history == ensemble.history == "before",
        12: (single.ridge_scale, single.ridge) == ("absolute", 100.0)
        and (ensemble.ridge_scale, ensemble.ridge) == ("absolute", Uniform(50, 150)),
        14: study is None or not study.calibrates,
        15: single.delay_rows == ensemble.delay_rows == "ridge",
        23: single.window == 640 and ensemble.window == Uniform("10 T", "30 T"),
        24: (preparation.low_pass, preparation.anti_alias) == ((10.0, 10.75), False),
    }
    if study is not None:
        test = next(iter(study.tests.values()))
        variant = judge.VARIANTS["paper"]
        out |= {
            3: (study.training.scheme, study.training.windows) == ("halves", 10),
            16: variant["block_length"] == "carlstein",
            19: variant["bandwidth"] == "paper",
            21: study.statistics.n_series == 100,
            22: variant["joins"] is True and test.placement == "random",
            25: (test.length, test.windows) == (15.0, 10),
            26: paper_welch(1 / 500)[:2] == (4096, 128),
        }
    return out


def same_in_both(row):
    first, second = ROWS[row]
    return second.startswith(("the same", first))


@pytest.mark.parametrize("door", DOORS)
def test_the_papers_column_is_taken_in_every_row(tank, door):
    found = DOORS[door](tank, "paper")
    assert sorted(ROWS) == list(range(1, 32))
    checked = paper(found)
    assert checked == dict.fromkeys(checked, True)
    left = set(ROWS) - set(checked) - {row for row in ROWS if same_in_both(row)}
    elsewhere = OF_TRAINING | OF_JUDGEMENT if door == "fit" else set()
    assert left <= elsewhere
    assert not elsewhere & set(checked)
    if door == "reproduce":
        regular = [each for name, each in found.study.tests.items() if name.startswith("regular")]
        assert {(each.windows, each.startup) for each in regular} == {(10, 20.0)}  # rows 30, 31
    # Rows that both columns decide alike and a setting could change all the same.
    single, ensemble = found.specs
    names = found.campaign.settings.channel_names
    inputs = found.campaign.model().inputs
    assert len(inputs) == 2  # row 7
    assert all(map(is_elevation, inputs))
    assert set(inputs) <= set(names)
    assert single.state_delays == 32  # rows 8 and 10: one period of 1.64 s, to the nearest
    assert ensemble.state_delays == Uniform("0.5 T", "1.5 T")  # row 11
    assert found.campaign.settings.celerity_channels == ("eta_fwd", "eta_cog")  # row 4
    assert found.campaign.settings.rig.positions["eta_fwd"] == 48.42  # row 27


@pytest.mark.parametrize("door", ["fit", "study"])
def test_the_recommended_column_is_another_wherever_it_says_so(tank, door):
    found = DOORS[door](tank, "recommended")
    single, ensemble = found.specs
    preparation = found.campaign.settings.preparation
    assert (preparation.low_pass, preparation.anti_alias) == (None, True)  # row 24
    assert single.delay_rows == ensemble.delay_rows == "exact"  # row 15
    assert single.ridge_scale == ensemble.ridge_scale == "per_snapshot"  # row 12
    assert not isinstance(ensemble.ridge, Uniform)
    assert single.window is None  # row 23: all of the runs
    assert ensemble.window is None
    for each in found.specs:
        assert each.alignment is None or each.alignment.surge != "measured"  # row 6
    assert found.study is None or found.study.calibrates  # row 14
