"""Other kinds of models beside a Hankel model, by free runs on the same windows."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from free_runs import held_out_scores
from near import assert_near
from oscillators import OF_ARX, arx_run
from squared import INPUTS, PERIOD, STATES, runs

from seakeep import HankelDMDc, tune
from seakeep.baselines import ARX, FIR, Subspace
from seakeep.campaign import ModelSettings
from seakeep.study.resolve import resolve_model
from seakeep.tuning import tuned_campaign

SPEC = HankelDMDc(6, 12, 1e-3, delay_rows="exact", ridge_scale="per_snapshot", lead=3)


def damped(radius, noise):
    """Four runs of a motion of 16 samples a period."""
    a = 2 * radius * np.cos(2 * np.pi / 16), -(radius**2)
    return {f"run {seed}": arx_run(seed, a, [1.0], 600, 1.6, noise) for seed in range(4)}


def test_scores_of_kinds_are_those_of_a_plain_loop_of_fits_and_forecasts():
    given = runs()
    result = tune(SPEC, given, STATES, INPUTS, vary=["kind"], horizon=(15,))
    table = result.table
    kinds = {
        "fir": FIR(12, lead=3),
        "arx": ARX(6, 12, ridge_scale="per_snapshot", lead=3),
        "subspace": Subspace(6, 12, 0.1, lead=3),
    }
    assert set(table["kind"].values.tolist()) == {"hankel_dmdc", *kinds}
    for kind, spec in kinds.items():
        row = table.isel(trial=np.flatnonzero(table["kind"].values == kind)[-1])
        own = replace(spec, ridge=float(row["ridge"]))
        found = held_out_scores(own, given, STATES, INPUTS, 15 * PERIOD, 12)
        # Windows side by side are summed in another order than one by one.
        assert_near(row["score"], np.mean(found), 1e-9)
    pytest.importorskip("matplotlib")
    legend = result.figure().legends[0].get_texts()
    drawn = [each.get_text().split(",")[0] for each in legend[:-1]]
    assert set(drawn) == {f"kind {kind}" for kind in ("hankel_dmdc", *kinds)}
    # A vessel with a memory stays a Hankel model.
    assert isinstance(result.settings, HankelDMDc)
    assert "kind = " not in result.note


def test_a_kind_that_is_better_beyond_the_noise_is_taken_by_tune():
    """That `fit` names it: `tests/study/test_fit.py`."""
    b = [1.0, -0.5, 0.3]  # in noise as large as the motion
    given = {f"run {seed}": arx_run(seed, [], b, 200, 0.4, 1.0) for seed in range(4)}
    # The waves tell all but the noise, which 41 delayed states in it learn by heart.
    spec = HankelDMDc(40, 3, 1e-5, delay_rows="exact", ridge_scale="per_snapshot")
    result = tune(spec, given, *OF_ARX, vary=["kind"], horizon=(5,))
    assert "kind = 'fir' errs 0." in result.note
    assert isinstance(result.settings, FIR)
    assert result.settings.input_delays == 3
    model = result.settings.fit(given, *OF_ARX)
    taps = model.B[0] * model.state_std / model.input_std
    # Of 4 runs of 200 samples in noise of SD 1.2: to 0.04 each.
    assert_near(taps, [*b, 0.0], 0.12)


def test_recommended_names_a_subspace_model_where_noise_spoils_delayed_states():
    """A weakly damped motion with a third of noise: states regressed on it decay too fast."""
    given = damped(0.98, 0.3)
    spec = HankelDMDc(6, 6, "rollout", delay_rows="exact", ridge_scale="per_snapshot")
    chosen = spec.settled(given, *OF_ARX)
    assert "kind = 'subspace' errs 0." in chosen.note
    assert isinstance(chosen.settings, HankelDMDc)
    assert chosen.rival is None  # no host runs it
    # Runs that are shorter than its past and future stop nothing.
    short = {name: run.isel(time=slice(75)) for name, run in given.items()}
    few = replace(spec, state_delays=40, select={"horizon": 1.0})
    assert "subspace" not in few.settled(short, *OF_ARX).note
    # Nor does one, which is held out first.
    one = given | {"run 0": given["run 0"].isel(time=slice(25))}
    few = replace(spec, state_delays=12, input_delays=12, select={"horizon": 0.5})
    assert "subspace" not in few.settled(one, *OF_ARX).note


def test_a_filter_is_taken_where_a_subspace_model_is_better_still():
    """A damped motion that 31 delayed inputs tell, in noise that spoils three delayed states."""
    spec = HankelDMDc(2, 30, "rollout", delay_rows="exact", ridge_scale="per_snapshot")
    chosen = spec.settled(damped(0.6, 1.0), *OF_ARX)
    assert "kind = 'subspace' errs 0." in chosen.note
    assert isinstance(chosen.rival, FIR)


@pytest.mark.parametrize("spec", [FIR(24, 1e-3, lead=3), Subspace(8, 24, 0.1), ARX(8, 16, 1e-2)])
def test_a_tuned_file_states_the_kind_and_what_it_takes(spec):
    text = """[model]
preset = "recommended"
states = ["heave"]
inputs = ["eta"]
alignment = { surge = "none" }
lead = 0
"""
    table = tomllib.loads(tuned_campaign(text, None, spec, ["kind"], "recommended", 16.0))["model"]
    assert {"preset", "alignment"}.isdisjoint(table)
    again = resolve_model(ModelSettings(**table), 1.6, 0.1, aligned=True).spec
    assert replace(again, ridge=spec.ridge) == again == spec
