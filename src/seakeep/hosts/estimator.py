"""C99 sources of an estimator: what ``model.live()`` computes, without Python."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from seakeep.conventions import is_elevation
from seakeep.core.bands import PER_OCTAVE
from seakeep.hosts.c import content_of, identifier, rendered, sources, write_sources
from seakeep.hosts.program import exportable
from seakeep.models import HankelDMDcModel, Model
from seakeep.models.live import DOUBTED
from seakeep.models.validity import CYCLES, TRAINED
from seakeep.signals.prediction import MEMORY, NOISE
from seakeep.waves import GRAVITY


def write_estimator(
    model: Model,
    folder: str | Path,
    name: str = "rom",
    noise: Mapping[str, float] | None = None,
    roles: Mapping[str, str] | None = None,
) -> list[Path]:
    """Write a model and its estimator as C99: the files of ``write_c``, and ``NAME_estimator.…``.

    Parameters
    ----------
    model : Model
        As for :func:`seakeep.hosts.write_c`.
    folder, name
        As for :func:`seakeep.hosts.write_c`.
    noise, roles : mapping, optional
        As for ``model.live``; a known input stays at its last value where no plan is given.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    RequestError
        If the model cannot be exported, or a file is there that seakeep did not write.
    """
    linear, name = exportable(model, follows=True), identifier(name)
    return write_sources(followed(linear, name, noise, roles), folder)


def followed(
    model: HankelDMDcModel,
    name: str,
    noise: Mapping[str, float] | None = None,
    roles: Mapping[str, str] | None = None,
) -> dict[str, str]:
    """Text of the C files of a model and its estimator, by their names."""
    content = content_of(model, name) | model.live(noise=noise, roles=roles).equations
    content |= {"begins": model.history_samples, "memory": MEMORY, "pi": math.pi}
    content |= {"noise_part": NOISE, "doubted": DOUBTED}
    content |= {"coverage": model.coverage, "trained": TRAINED, "cycles": CYCLES}
    content |= {"gravity": GRAVITY, "per_octave": PER_OCTAVE, "is_elevation": is_elevation}
    files = ("estimator.h", "estimator.c")
    return sources(model, name) | {f"{name}_{file}": rendered(file, **content) for file in files}
