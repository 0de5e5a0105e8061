"""The paper's study on the virtual tank in three acts: played, prepared, identified, judged.

All acts forecast the same windows of the same six runs. The first takes the slow drift out of the
channels that carry it, the second leaves it in, the third gives it to the recommended model.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from seakeep.arrays import Progress
from seakeep.campaign import read_campaign, write_prepared
from seakeep.errors import needing
from seakeep.executor import ending, on_this_machine, one_blas_thread, versions
from seakeep.files import MARK, check_output, check_report, is_there, write_text
from seakeep.study.plan import named
from seakeep.study.run import run_study
from seakeep.study.settings import Preset, read_study
from seakeep.study.store import StudyResult, read_result, storing
from seakeep.toml import rendered

NOTE = (
    "Virtual tank: a made-up vessel in made-up seas, so no number here replicates the paper's. Its "
    "raw files come from four loggers with clocks of their own, with noise, drop-outs and slap, "
    "and were prepared as a tank's would be."
)
WAVES = "√(2E Δf); 100 components at equal spacing, as the paper prints it"

SLOW = ("surge", "mooring_bow", "mooring_stern")
"""Channels that slow drift moves; all others move with the waves."""
HIGH_PASS = 0.15
"""Hz: below the slowest wave that is played (0.28 Hz), far above the drift (0.03 Hz)."""
HIGHEST = 9.0
"""Hz, the other edge of that band: just below the Nyquist frequency after resampling (9.75 Hz)."""

STUDY_FILE = "reproduction's study file"
CAMPAIGN_FILE = "reproduction's campaign file"
PLAYED = "note of a campaign played"


@dataclass(frozen=True)
class Act:
    """One of the three studies.

    Parameters
    ----------
    name : str
        Folder of its study.
    letter, words : str
        For headings.
    sentence : str
        What is done in it.
    preset : {"paper", "recommended"}
        Of its models.
    without_drift : bool
        Whether slow drift is removed from the channels that carry it.
    """

    name: str
    letter: str
    words: str
    sentence: str
    preset: Preset
    without_drift: bool = False

    @property
    def title(self) -> str:
        """Letter and words."""
        return f"{self.letter} {self.words}"


ACTS = (
    Act(
        "paper",
        "(a)",
        "the paper's procedure",
        f"Surge and both mooring loads have lost what is slower than {HIGH_PASS:g} Hz, their slow "
        "drift. That is inferred: behind the integration filter the paper's source has a comment, "
        "“along with detrending”.",
        "paper",
        without_drift=True,
    ),
    Act(
        "raw",
        "(b)",
        "the paper's procedure on raw channels",
        "The same models in the same windows forecast the channels as measured, drift included.",
        "paper",
    ),
    Act(
        "recommended",
        "(c)",
        "the recommended model",
        "The recommended model learns from the two other irregular runs and forecasts the "
        "channels as measured, in the same windows; it reads no motion measured after the start.",
        "recommended",
    ),
)


@dataclass(frozen=True)
class Size:
    """Counts of the studies; nothing else differs between the quick and the full ones.

    Parameters
    ----------
    training, tests : int
        Windows.
    members : int
        Members of the ensembles.
    series : int
        Bootstrapped series.
    """

    training: int = 10
    tests: int = 10
    members: int = 100
    series: int = 100

    @classmethod
    def quick(cls) -> Size:
        """Counts that show all stages in half of the time."""
        return cls(training=2, tests=2, members=10, series=20)


def reproduce(
    out: Path | str,
    preset: Preset | None = None,
    *,
    size: Size | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> dict[str, StudyResult]:
    """Play the virtual campaign and run the paper's study on it, in three acts.

    Parameters
    ----------
    out : Path or str
        Folder: ``campaign/`` for the raw files and the truth, and a folder per act with its
        ``study.toml`` and its results.
    preset : {"paper", "recommended"}, optional
        Play the acts of this preset alone: the first two, or the third.
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
    dict of str to StudyResult
        Results by act; a stopped act continues.

    Raises
    ------
    RequestError
        If the tank's libraries are not installed, or a folder holds another study.
    StorageError
        If the disk is full.
    """
    out, counts = Path(out), size or Size()
    acts = [act for act in ACTS if preset in (None, act.preset)]
    for act in acts:
        with storing(out):
            (out / act.name).mkdir(parents=True, exist_ok=True)
        check_output(out / act.name / "study.toml", STUDY_FILE)
    check_report(out)
    nominal = _play(out / "campaign", seed, executor, progress)
    campaigns = [out / "campaign" / "campaign.toml"]
    if any(act.without_drift for act in acts):
        campaigns.append(out / "campaign" / "detrended" / "campaign.toml")
        text = campaigns[0].read_text(encoding="utf-8")
        _write(campaigns[1], detrended_text(text), CAMPAIGN_FILE)
    prepare_campaigns(campaigns, executor, progress)
    results = {}
    for act in acts:
        path = out / act.name / "study.toml"
        _write(path, study_text(act, counts, seed), STUDY_FILE)
        results[act.name] = run_study(
            read_study(path),
            path.parent,
            executor=executor,
            progress=named(progress, f"{act.title}: "),
            extra={"nominal": nominal},
            notes={"preparation_note": f"{act.sentence} {NOTE}", "waves_note": WAVES},
        )
    return results


def read_reproduction(out: Path | str) -> dict[str, StudyResult]:
    """Read the results of the acts that a folder holds; empty where it holds none.

    Parameters
    ----------
    out : Path or str
        Folder of :func:`reproduce`.

    Returns
    -------
    dict of str to StudyResult
        By act.

    Raises
    ------
    RequestError, DataError
        As :func:`seakeep.study.read_result`.
    """
    played = [act.name for act in ACTS if is_there(Path(out) / act.name / "study.toml")]
    return {name: read_result(Path(out) / name) for name in played}


def _write(path: Path, text: str, kind: str) -> None:
    with storing(path.parent):
        path.parent.mkdir(exist_ok=True)
        check_output(path, kind)
        write_text(path, text)


def _play(
    folder: Path, seed: int, executor: Executor | None, progress: Progress | None
) -> xr.Dataset:
    """Play the campaign unless it lies there already; return its nominal spectra."""
    with needing("the virtual tank", "tank"):
        from seakeep.tank.play import play
        from seakeep.tank.seas import pierson_moskowitz
        from seakeep.tank.settings import default_settings, with_waves
    settings = with_waves(default_settings(), seed, "equal")
    content = json.dumps({"settings": settings.model_dump(mode="json"), "versions": versions()})
    digest = hashlib.sha256(content.encode()).hexdigest()
    mark = folder / "played.txt"
    text = f"{MARK}: {PLAYED}\n{digest}\n"
    if not mark.exists() or mark.read_bytes() != text.encode():
        if mark.exists():
            check_output(mark, PLAYED)
        with storing(folder):
            near, tell = on_this_machine(executor), named(progress, "playing ")
            play(settings, folder, executor=near, progress=tell)
        _write(mark, text, PLAYED)
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


def prepare_campaigns(
    campaigns: Sequence[Path], executor: Executor | None, progress: Progress | None
) -> None:
    """Write the prepared runs of campaigns, which lie side by side where workers are near."""
    near = on_this_machine(executor)
    if near is None:
        for path in campaigns:
            write_prepared(read_campaign(path), progress=named(progress, "preparing "))
        return
    first, *others = campaigns
    pending: list[Future[None]] = []
    with ending(near, pending):
        pending += [near.submit(_prepare, path) for path in others]
        write_prepared(read_campaign(first), progress=named(progress, "preparing "))
        for each in pending:
            each.result()


def _prepare(path: Path) -> None:
    with one_blas_thread():
        write_prepared(read_campaign(path))


def detrended_text(campaign: str) -> str:
    """Campaign file in which the drifting channels have lost what is slower than the waves.

    What was measured keeps a name of its own, ``NAME_with_drift``: the waves are still carried to
    where the vessel is.
    """
    text = campaign.replace('"raw/', '"../raw/')
    place = rf'^(\[(?:channels|derived)\.|(?:from|position) = ")({"|".join(SLOW)})(?=[]"])'
    text = re.sub(place, r"\1\2_with_drift", text, flags=re.M)
    texts = [
        f'[derived.{name}]\nfrom = "{name}_with_drift"\nstep = "band_pass"\n'
        f"band = [{HIGH_PASS:g}, {HIGHEST:g}]  # Hz\n"
        for name in SLOW
    ]
    head = f"# {MARK}: {CAMPAIGN_FILE}\n# campaign.toml without slow drift in three channels.\n"
    return "\n".join([head + text, *texts])


def study_text(act: Act, size: Size, seed: int) -> str:
    """Study file of an act."""
    return rendered(
        "study", "study.toml", act=act, size=size, seed=seed, mark=MARK, kind=STUDY_FILE
    )
