"""What the presets choose, row by row of the paper map, through each door that takes one."""

import re
from types import SimpleNamespace

import pytest
from pages import page

from seakeep import Uniform, read_campaign
from seakeep.campaign.settings import is_elevation
from seakeep.signals.waves import paper_welch
from seakeep.study import judge, read_study
from seakeep.study.reproduce import ACTS, Size, study_text
from seakeep.study.resolve import can_align, resolve_model

pytest.importorskip("numba")

PERIOD, DT, ENSEMBLE = 1.64, 1.64 / 32, "bayesian_hankel_dmdc"
ROWS = {
    int(cells[1]): (cells[3].strip(), cells[4].strip())
    for line in page("paper_map.md").splitlines()
    if (cells := line.split("|"))[1:] and re.fullmatch(r" \d+ ", cells[1])
}
NOT_OF_FIT = {3, 16, 19, 21, 22, 25, 26}
"""Rows on the waves that are played and train, the campaign's for `fit`, and on judging."""


def found(folder, door):
    """Specs of the single model and the ensemble, by the paper's preset of [model] or a study.

    On the virtual tank's campaign file, without its raw files.
    """
    from seakeep.tank.play import campaign_text
    from seakeep.tank.settings import default_settings

    settings = default_settings()
    files = {run: {"wave_probes": f"{run}.csv"} for run in settings.runs}
    text = campaign_text(settings, files, "csv", one_logger=False)
    path = folder / "campaign/campaign.toml"
    path.parent.mkdir()
    of_model = "paper" if door == "fit" else "recommended"
    model = re.sub(r'(\[model\][^[]*?)preset = "\w+"', rf'\1preset = "{of_model}"', text)
    path.write_text(re.sub(r'(\[preparation\]\n)preset = "\w+"\n', r"\1", model), "utf-8")
    if door == "fit":
        campaign, study = read_campaign(path), None
        tables = [campaign.model(), campaign.model().model_copy(update={"kind": ENSEMBLE})]
    else:
        act = next(act for act in ACTS if act.preset == "paper" and not act.without_drift)
        says = '[study]\ncampaign = "../campaign/campaign.toml"\n'  # the preset is left out
        file = folder / act.name / "study.toml"
        file.parent.mkdir()
        file.write_text(says if door == "study" else study_text(act, Size(), 0), "utf-8")
        read = read_study(file)
        campaign, study = read.campaign, read.settings
        tables = [study.models[name] for name in ("deterministic", "bayesian")]
    aligned = can_align(campaign.settings, campaign.model().inputs)
    above = study and study.study.preset
    specs = [resolve_model(each, PERIOD, DT, preset=above, aligned=aligned).spec for each in tables]
    return SimpleNamespace(campaign=campaign, specs=specs, study=study)


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


@pytest.mark.parametrize("door", ["fit", "study", "reproduce"])
def test_the_papers_column_is_taken_in_every_row(tmp_path, door):
    taken = found(tmp_path, door)
    checked = paper(taken)
    assert checked == dict.fromkeys(checked, True)
    same = {row for row, (theirs, ours) in ROWS.items() if ours.startswith(("the same", theirs))}
    elsewhere = NOT_OF_FIT if door == "fit" else set()
    assert set(ROWS) - set(checked) - same <= elsewhere
    assert not elsewhere & set(checked)
    if door == "reproduce":
        regular = [each for name, each in taken.study.tests.items() if name.startswith("regular")]
        assert {(each.windows, each.startup) for each in regular} == {(10, 20.0)}  # rows 30, 31
    # Rows that both columns decide alike and a setting could change all the same.
    single, ensemble = taken.specs
    assert list(map(is_elevation, taken.campaign.model().inputs)) == [True, True]  # row 7
    assert single.state_delays == 32  # rows 8 and 10: one period of 1.64 s, to the nearest
    assert ensemble.state_delays == Uniform("0.5 T", "1.5 T")  # row 11
    assert taken.campaign.settings.celerity_channels == ("eta_fwd", "eta_cog")  # row 4
    assert taken.campaign.settings.rig.positions["eta_fwd"] == 48.42  # row 27
