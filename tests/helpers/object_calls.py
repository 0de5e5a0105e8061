"""Public functions and methods above those of arrays, with sound arguments."""

from pathlib import Path
from typing import Any

import numpy as np

import seakeep
from seakeep import campaign as campaigns
from seakeep import check, formats, hosts, models, plot, study
from seakeep.baselines import ARX

Calls = dict[str, tuple[Any, dict[str, Any]]]


def object_calls() -> Calls:
    """Calls by name, in the folder of a small campaign that was prepared."""
    campaign = seakeep.read_campaign("campaign.toml")
    runs = campaigns.load_prepared(campaign)
    run = runs["one"]
    short = {"one": run.isel(time=slice(0, 400))}
    aligned, arx = seakeep.load_model("model.nc"), seakeep.load_model("arx.nc")
    states, inputs = list(aligned.states), list(aligned.inputs)
    channels = {"states": states, "inputs": inputs}
    spec = seakeep.HankelDMDc(4, 4, 1.0)
    period = campaign.encounter_period()
    bayes = seakeep.BayesianHankelDMDc.paper(period, n_members=2)
    model, ensemble = spec.fit(runs, **channels), bayes.fit(runs, **channels)
    live = arx.live()
    for _ in range(30):
        live.step(np.zeros(len(arx.inputs)), np.zeros(len(arx.states)))
    live.save("live.nc")
    forecast, band = model.forecast(run, 45.0, 40), ensemble.forecast_summary(run, 45.0, 40)
    compared = study.compare(model, campaign)
    window = {"run": run, "start": 45.0, "steps": 20, "ahead": "refuse"}
    windows = {"run": run, "starts": [45.0, 46.0], "steps": 20, "ahead": "refuse"}
    workers = {"executor": None, "progress": None}
    bands = {"level": 0.95, "band": "members"}
    arrays = {"x_history": np.zeros((200, len(states))), "u_history": np.zeros((200, len(inputs)))}
    future = {"u_future": np.zeros((400, len(inputs))), "steps": 20, "ahead": "refuse"}
    return {
        **_settings(spec, period, aligned),
        **_checks(model, runs, short),
        "HankelDMDc.fit": (spec.fit, {"runs": short, **channels, "stop": None, **workers}),
        "BayesianHankelDMDc.fit": (bayes.fit, {"runs": runs, **channels, "stop": None, **workers}),
        "ARX.fit": (ARX(2, 2).fit, {"runs": short, **channels, "stop": None}),
        "tune": (seakeep.tune, {"spec": spec, "runs": short, **channels, "vary": ("ridge",),
                                "horizon": (2.0,), "folds": "run", "stop": None}),
        "model.forecast": (aligned.forecast, window),
        "model.forecast_windows": (aligned.forecast_windows, {**windows, **workers}),
        "model.forecast_arrays": (model.forecast_arrays, {**arrays, **future}),
        "model.initial_state": (model.initial_state, {"run": run, "start": 45.0}),
        "model.initial_state_arrays": (model.initial_state_arrays, arrays),
        "model.aligned_inputs": (aligned.aligned_inputs, {"run": run}),
        "model.live": (arx.live, {"like": run, "noise": {"heave": 0.1}}),
        "model.save": (model.save, {"path": "x.nc"}),
        "model.to_mat": (model.to_mat, {"path": "x.mat"}),
        "ensemble.forecast": (ensemble.forecast, {**window, **workers}),
        "ensemble.forecast_summary": (ensemble.forecast_summary, {**window, **bands}),
        "ensemble.forecast_windows": (ensemble.forecast_windows, windows),
        "ensemble.summarize_windows": (ensemble.summarize_windows, {**windows, **bands}),
        "ensemble.calibrate": (ensemble.calibrate, {
            "runs": short, "steps": 20, "level": 0.95, "scale": "spread", "folds": None}),
        "ensemble.hold": (ensemble.hold, workers),
        "ensemble.member": (ensemble.member, {"number": 0}),
        "ensemble.without": (ensemble.without, {"run": "one"}),
        "ensemble.spectral_radii": (ensemble.spectral_radii, workers),
        "held.forecast_arrays": (ensemble.hold().forecast_arrays, {**arrays, **future, **bands}),
        "live.step": (live.step, {"u": np.zeros(len(arx.inputs)),
                                  "y": np.zeros(len(arx.states)), "time": None}),
        "live.forecast": (live.forecast, {"steps": 9, "future": None, "level": 0.9, "share": 0.5}),
        "live.save": (live.save, {"path": "again.nc"}),
        "load_live": (seakeep.load_live, {"model": arx, "path": "live.nc"}),
        "load_model": (seakeep.load_model, {"path": "model.nc", "kind": None}),
        "compare_waves": (models.compare_waves, {
            "model": model, "run": run, "start": 45.0, "steps": 200}),
        "outside_training": (models.outside_training, {
            "model": model, "run": run, "start": 45.0, "steps": 200}),
        "estimate_probe_offset": (models.estimate_probe_offset, {
            "model": aligned, "run": run, "span": (20.0, 50.0), "bounds": (-0.2, 0.2), "seed": 0}),
        "is_ensemble": (models.is_ensemble, {"model": model}),
        "summarize": (seakeep.summarize, {
            "forecast": ensemble.forecast(run, 45.0, 40), "level": 0.95}),
        **_of_campaign(campaign),
        "start_rows": (hosts.start_rows, {"model": model, "run": run, "start": 45.0}),
        "write_c": (hosts.write_c, {"model": model, "folder": "c", "name": "rom"}),
        "plot.overlay": (plot.overlay, {
            "forecast": forecast, "measured": run, "channels": None, "axes": None}),
        "plot.band": (plot.band, {
            "forecast": band, "measured": run, "level": 0.95, "channels": None, "axes": None}),
        "plot.errors": (plot.errors, {"table": study.comparison_table(compared), "axes": None}),
        "study.compare": (study.compare, {
            "model": model, "campaign": campaign, "runs": ("one",), "start": None, "steps": None,
            "progress": None, "members": None, **bands}),
        "study.compare_models": (study.compare_models, {
            "models": {"a": model}, "campaign": campaign, "runs": ("one",), "start": None,
            "steps": None}),
        "study.comparison_table": (study.comparison_table, {
            "comparisons": compared, "intervals": True}),
        "study.difference_table": (study.difference_table, {
            "found": {"a": compared, "b": compared}}),
        "study.at_full_scale": (study.at_full_scale, {"comparison": compared[0], "scale": 20.0}),
        "study.in_degrees": (study.in_degrees, {"comparison": compared[0]}),
        "study.forecast_at_full_scale": (study.forecast_at_full_scale, {
            "forecast": forecast, "scale": 20.0}),
        "study.to_full_scale": (study.to_full_scale, {
            "run": run, "scale": 20.0, "density_ratio": 1.0}),
        "study.with_degrees": (study.with_degrees, {"run": run}),
        "study.training_runs": (study.training_runs, {"prepared": short, "window": None}),
        "study.fit_baselines": (study.fit_baselines, {
            "campaign": campaign, **channels, "progress": None, "prepared": short}),
        "study.fit_campaign": (study.fit_campaign, {
            "campaign": campaign, "model": "arx", **workers}),
        "study.nowcast": (study.nowcast, {
            "model": arx, "run": run, "steps": 10, "share": 0.5, "level": 0.95}),
        "study.nowcasts": (study.nowcasts, {
            "models": {"a": arx}, "campaign": campaign, "runs": ("one",), "steps": 10,
            "share": 0.5, "level": 0.95}),
        "study.build_spec": (study.build_spec, {
            "settings": campaign.model("arx"), "encounter_period": period, "dt": 0.05,
            "aligned": False}),
        "study.read_study": (study.read_study, {"path": "study.toml"}),
        "study.read_result": (study.read_result, {"folder": "results"}),
        "is_recording_folder": (formats.is_recording_folder, {"path": Path()}),
        "read_columns": (formats.read_columns, {"path": "one_mru.csv", "options": None}),
    }  # fmt: skip


def _settings(spec: seakeep.HankelDMDc, period: float, aligned: Any) -> Calls:
    """Classes of settings, and their presets."""
    uniform = seakeep.Uniform(0.5, 1.0)
    alignment = aligned.signature.input_map.alignment.settings
    return {
        "HankelDMDc": (seakeep.HankelDMDc, {
            "state_delays": 4, "input_delays": 4, "ridge": 1.0, "window": None,
            "history": "before", "delay_rows": "ridge", "ridge_scale": "absolute", "rank": None,
            "standardize": True, "alignment": None, "lead": 0, "observables": (),
            "stable": False, "readouts": (), "select": None}),
        "HankelDMDc.paper": (seakeep.HankelDMDc.paper, {"encounter_period": period, "dt": 0.05}),
        "HankelDMDc.recommended": (seakeep.HankelDMDc.recommended, {
            "encounter_period": period, "dt": 0.05, "runs": None}),
        "HankelDMDc.needs": (spec.needs, {"dt": 0.05}),
        "BayesianHankelDMDc": (seakeep.BayesianHankelDMDc, {
            "encounter_period": period, "train_length": seakeep.Uniform(10, 20),
            "state_delay": uniform, "input_delay": uniform, "ridge": uniform, "n_members": 2,
            "seed": 0, "dt": None}),
        "BayesianHankelDMDc.recommended": (seakeep.BayesianHankelDMDc.recommended, {
            "encounter_period": period, "dt": None, "n_members": 2, "seed": 0, "runs": None}),
        "ARX": (ARX, {"state_delays": 2, "input_delays": 2}),
        "Uniform": (seakeep.Uniform, {"low": 1.0, "high": 2.0}),
        "LogUniform": (seakeep.LogUniform, {"low": 1.0, "high": 2.0}),
        "Fixed": (seakeep.Fixed, {"value": 1.0}),
        "SlowSquares": (seakeep.SlowSquares, {"of": "eta_fwd", "period": None}),
        "Powers": (seakeep.Powers, {"of": "eta_fwd", "powers": (2,), "products": False}),
        "Expression": (seakeep.Expression, {"name": "a", "expression": "eta_fwd**2"}),
        "ReadOut": (seakeep.ReadOut, {"channel": "heave", "of": ("pitch",), "kind": "hinge"}),
        "Select": (seakeep.Select, {
            "observables": True, "horizon": (15.0,), "period": None, "folds": "run"}),
        "ProbeAlignment": (seakeep.ProbeAlignment, dict(vars(alignment))),
    }  # fmt: skip


def _checks(model: Any, runs: dict[str, Any], short: dict[str, Any]) -> Calls:
    """Checks of a model, and their figures."""
    of = {"model": model, "runs": short}
    long = {"model": model, "runs": runs}
    states, axes = {"states": None}, {"axes": None}
    statistics = check.statistics(**long)
    return {
        "check.check_model": (check.check_model, {**of, "progress": None, "baselines": None}),
        "check.coherence": (check.coherence, {**of, "free": None, "baselines": None}),
        "check.decay": (check.decay, {"model": model}),
        "check.drift": (check.drift, of),
        "check.measured_decay": (check.measured_decay, of),
        "check.measured_response": (check.measured_response, of),
        "check.modes": (check.modes, {"model": model}),
        "check.residuals": (check.residuals, {**of, "free": None}),
        "check.response": (check.response, {
            "model": model, "frequencies": [0.3, 0.5], "runs": None}),
        "check.statistics": (check.statistics, {**long, "duration": None, "free": None}),
        "check.validation": (check.validation, {**of, "measured": None}),
        "check.validity": (check.validity, of),
        "check.worth": (check.worth, {**long, "baselines": None, "free": None}),
        "plot.decay": (plot.decay, {"found": check.decay(model), **axes}),
        "plot.density": (plot.density, {"found": statistics, **states, **axes}),
        "plot.exceedance": (plot.exceedance, {"found": statistics, **states, **axes}),
        "plot.modes": (plot.modes, {"found": check.modes(model), "most": 12, **axes}),
        "plot.residuals": (plot.residuals, {"found": check.residuals(**long), **states, **axes}),
        "plot.response": (plot.response, {
            "found": check.response(model), "measured": None, **states, **axes}),
        "plot.validity": (plot.validity, {"found": check.validity(**long), **axes}),
    }  # fmt: skip


def _of_campaign(campaign: seakeep.Campaign) -> Calls:
    """Functions and methods of campaigns and their files."""

    def each_prepared(**given: Any) -> list[Any]:
        return list(campaign.each_prepared(**given))

    names, progress = {"names": ["one"]}, {"progress": None}
    return {
        "campaign.basis_of": (campaign.basis_of, {"name": "one"}),
        "campaign.checksum_of": (campaign.checksum_of, {"name": "one"}),
        "campaign.clocks": (campaign.clocks, names),
        "campaign.each_prepared": (each_prepared, {**names, **progress, "failures": None}),
        "campaign.files_of": (campaign.files_of, {"name": "one"}),
        "campaign.live_chain": (campaign.live_chain, {
            "run": "one", "delay": "1 T", "window": "40 T", "every": 8}),
        "campaign.model": (campaign.model, {"name": None}),
        "campaign.prepare": (campaign.prepare, {**names, **progress}),
        "campaign.read_run": (campaign.read_run, {"name": "one"}),
        "campaign.seconds": (campaign.seconds, {"stated": "1 T"}),
        "draft_campaign": (campaigns.draft_campaign, {
            "files": ["one_mru.csv"], "folder": ".", "options": None}),
        "load_prepared": (campaigns.load_prepared, {
            "campaign": campaign, "out_dir": None, **names, **progress}),
        "read_campaign": (seakeep.read_campaign, {"path": "campaign.toml", "preset": None}),
        "read_table": (campaigns.read_table, {
            "path": "one_mru.csv", "options": None, "columns": None}),
        "write_prepared": (campaigns.write_prepared, {
            "campaign": campaign, "out_dir": "out", **names, **progress, "anew": False,
            "failures": None}),
    }  # fmt: skip
