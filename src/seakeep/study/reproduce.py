"""The paper's study on the virtual tank: played, prepared, identified, judged, from nothing."""

from __future__ import annotations

import hashlib
import json
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from seakeep.campaign.prepare import Progress
from seakeep.errors import RequestError
from seakeep.files import MARK, check_output, replacing
from seakeep.study.run import run_study
from seakeep.study.settings import Preset, read_study
from seakeep.study.store import StudyResult, storing, versions

__all__ = ["Size", "reproduce"]

NOTE = (
    "Virtual tank: a made-up vessel in made-up seas, so no number here replicates the paper's. Its "
    "raw files come from four loggers with clocks of their own, with noise, drop-outs and slap, "
    "and were prepared as a tank's would be."
)

WAVES = {
    "paper": "√(2E Δf); 100 components at equal spacing, as printed",
    "recommended": "√(2E Δf); 100 components at jittered frequencies, which do not repeat",
}

STUDY_FILE = "reproduction's study file"


@dataclass(frozen=True)
class Size:
    """Counts of the study; nothing else differs between the quick and the full one.

    Parameters
    ----------
    training, tests : int
        Windows.
    members : int
        Members of the ensemble.
    series : int
        Bootstrapped series.
    """

    training: int = 10
    tests: int = 10
    members: int = 100
    series: int = 100

    @classmethod
    def quick(cls) -> Size:
        """Counts that show all stages in less than a minute."""
        return cls(training=2, tests=2, members=10, series=20)


def reproduce(
    out: Path | str,
    preset: Preset = "paper",
    *,
    size: Size | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> StudyResult:
    """Play the virtual campaign and run the paper's study on it.

    Parameters
    ----------
    out : Path or str
        Folder: ``campaign/`` for the raw files and the truth, ``study.toml``, and the results.
    preset : {"paper", "recommended"}, optional
        The paper's choices, or ours: leave-one-run-out, windows without overlap, waves that do not
        repeat.
    size : Size, optional
        Counts; the default is the paper's.
    seed : int, optional
        Of the waves, the noise, the windows and the draws.
    executor
        As in :func:`seakeep.study.run_study`.
    progress : callable, optional
        Called as ``progress(done, total, what)``.

    Returns
    -------
    StudyResult
        All that was found; a study that was stopped goes on.

    Raises
    ------
    RequestError
        If the tank's libraries are not installed, or the folder holds another study.
    StorageError
        If the disk is full.
    """
    out, counts = Path(out), size or Size()
    with storing(out):
        out.mkdir(parents=True, exist_ok=True)
    check_output(out / "study.toml", STUDY_FILE)
    nominal = _play(out / "campaign", preset, seed, progress)
    with storing(out), replacing(out / "study.toml") as temporary:
        temporary.write_text(study_text(preset, counts, seed), encoding="utf-8")
    return run_study(
        read_study(out / "study.toml"),
        out,
        executor=executor,
        progress=progress,
        extra={"nominal": nominal},
        notes={"preparation_note": NOTE, "waves_note": WAVES[preset]},
    )


def _play(folder: Path, preset: Preset, seed: int, progress: Progress | None) -> xr.Dataset:
    """Play the campaign unless it lies there already; return its nominal spectra."""
    try:
        from seakeep.tank.play import play
        from seakeep.tank.seas import pierson_moskowitz
        from seakeep.tank.settings import default_settings, with_waves
    except ImportError as error:
        raise RequestError(
            f"the virtual tank needs {error.name}, which is not installed. Install it with: pip "
            "install 'seakeep[tank]'"
        ) from error
    spacing = "equal" if preset == "paper" else "jittered"
    settings = with_waves(default_settings(), seed, spacing)
    made = json.dumps({"settings": settings.model_dump(mode="json"), "versions": versions()})
    digest = hashlib.sha256(made.encode()).hexdigest()
    mark = folder / "played.txt"
    if not mark.exists() or mark.read_text(encoding="utf-8").strip() != digest:
        with storing(folder):
            play(settings, folder, progress=_playing(progress))
            mark.write_text(digest + "\n", encoding="utf-8")
    frequency = np.linspace(0.2, 1.5, 261)
    spectra = {
        "nominal": (0.15, 2.12, "nominal, the paper's sea state (0.15 m, 2.12 s)"),
        "played": (0.162, 2.05, "as played (0.162 m, 2.05 s)"),
    }
    return xr.Dataset(
        {
            name: (
                "frequency",
                pierson_moskowitz(frequency, height, period),
                {"units": "m^2/Hz", "long_name": words},
            )
            for name, (height, period, words) in spectra.items()
        },
        coords={"frequency": ("frequency", frequency, {"units": "Hz"})},
    )


def _playing(progress: Progress | None) -> Progress | None:
    if progress is None:
        return None
    report = progress
    return lambda done, total, name: report(done, total, f"playing {name}")


def study_text(preset: Preset, size: Size, seed: int) -> str:
    """Study file of the reproduction."""
    paper = preset == "paper"
    training = (
        ['scheme = "halves"', f"windows = {size.training}", 'placement = "random"']
        if paper
        else ['scheme = "leave_out"', 'leave_out = "run"']
    )
    placement = "random" if paper else "apart"
    alignment = ['alignment = { mode = "effective", surge = "measured" }'] if paper else []
    lines = [
        "# The paper's study on the virtual tank; written by `seakeep reproduce`.",
        f"# {MARK}: {STUDY_FILE}",
        "[study]",
        'name = "Virtual CK-14e"',
        'description = "HDMDc and BHDMDc of a moored vessel with a moon pool in head seas; data '
        'of the virtual towing tank"',
        'campaign = "campaign/campaign.toml"',
        'truth = "campaign/truth"',
        f'preset = "{preset}"',
        f"seed = {seed}",
        "",
        "[training]",
        *training,
        "",
        "[models.deterministic]",
        'kind = "hankel_dmdc"',
        *alignment,
        "",
        "[models.bayesian]",
        'kind = "bayesian_hankel_dmdc"',
        f"n_members = {size.members}",
        *alignment,
        "",
    ]
    sets = {"irregular": ('waves = "irregular"', "irregular", 15)}
    for name, ratio in (("regular_1_5", "1.5"), ("regular_2", "2"), ("regular_3", "3")):
        sets[name] = (f'runs = ["{name}"]', f"regular, λ/L {ratio}", 5)
    if not paper:
        sets["irregular_long"] = ('waves = "irregular"', "irregular, long horizon", 45)
    for name, (runs, label, length) in sets.items():
        lines += [
            f"[tests.{name}]",
            runs,
            f'label = "{label}"',
            f"length = {length}",
            f"windows = {size.tests}",
            f'placement = "{placement}"',
            "",
        ]
    lines += ["[statistics]", f"n_series = {size.series}", "", "[output]", "paper = true", ""]
    return "\n".join(lines)
