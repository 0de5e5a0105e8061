"""What a draft proposes beyond the channels: derived ones, preparation, states and delays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import tomlkit
from tomlkit.items import Table

from seakeep.campaign.guesses import MOTIONS, Guess, is_acceleration, words_of

__all__ = ["derived_examples", "driving_wave", "model_table", "preparation_table"]

_ORDER = ("heave", "pitch", "roll", "yaw", "surge", "sway")
"""Motions, those first that the waves alone move: an integral in their band is the whole motion."""

STEPS = 32
"""Steps a period that the paper takes, and a draft proposes."""


def derived_examples(names: Sequence[str], period: float | None, rate: float) -> list[str]:
    """Tables of derived channels that fit the channels there are, and clash with none.

    Parameters
    ----------
    names : sequence of str
        The channels.
    period : float or None
        Period of the waves, s.
    rate : float
        Samples a second of the fastest logger, for bands below its Nyquist frequency.

    Returns
    -------
    list of str
        Lines of TOML; together they can be used as they stand.
    """
    lines: list[str] = []
    sources = {m: f"{m}_acceleration" for m in _ORDER if f"{m}_acceleration" in names}
    for motion in _ORDER:
        pair = [n for n in names if is_acceleration(n) and motion in words_of(n)]
        if len(pair) == 2 and motion not in sources:
            sources = {motion: f"{motion}_acceleration", **sources}
            lines += [f"[derived.{motion}_acceleration]"]
            lines += [f'expression = "average({pair[0]}, {pair[1]})"']
    moved = [m for m in _ORDER if m in names and f"{m}_rate" not in names]
    if sources:
        motion, source = next(iter(sources.items()))
        how = ['step = "integrate"', f"band = {_band(period, rate)}"]
        if f"{motion}_rate" not in names:
            lines += [f"[derived.{motion}_rate]", f'from = "{source}"', *how]
        name = f"{motion}_of_acceleration" if motion in names else motion
        lines += [f"[derived.{name}]", f'from = "{source}"', *how, "times = 2"]
        if name != motion:
            lines += [
                f"[redundant.{motion}]  # compared on the data-quality sheet, the first is trusted",
                f'channels = ["{name}", "{motion}"]',
            ]
    elif moved:
        lines += [f"[derived.{moved[0]}_rate]", f'from = "{moved[0]}"', 'step = "differentiate"']
    return ["Channels may be made from others, such as:", *lines] if lines else []


def _band(period: float | None, rate: float) -> str:
    if period is None:
        return f"[0.4, {min(5.0, 0.4 * rate):.3g}]  # Hz"
    edges = f"[{0.3 / period:.2g}, {min(8.0 / period, 0.4 * rate):.2g}]"
    return f"{edges}  # Hz, around the waves"


def preparation_table(
    guesses: Sequence[Guess],
    rates: Mapping[str, float | None],
    period: float | None,
    shortest: float | None,
) -> Table:
    """Draft of ``[preparation]``: one step for all, and what to do about gaps.

    Parameters
    ----------
    guesses : sequence of Guess
        The channels.
    rates : mapping of str to float or None
        Samples a second by logger.
    period, shortest : float or None
        Period of the first run's waves, and the shortest of all runs', s.

    Returns
    -------
    Table
        The table; no step is finer than that of the fastest logger.
    """
    table = tomlkit.table()
    known = [rate for rate in rates.values() if rate]
    for logger, rate in rates.items():
        if rate and not logger:
            table.add(tomlkit.comment(f"the files have {rate:.6g} samples a second"))
    fine = period is not None and STEPS / period > max(known, default=np.inf)
    usual = f"sampling_rate = {float(f'{min([25.0, *known]):.6g}')}  # Hz"
    if len(rates) > 1 and period is not None and not fine:
        table.add("steps_per_period", STEPS)
        table["steps_per_period"].comment(
            f"guessed: samples a mean period, here about {STEPS / period:.3g} Hz"
        )
        table.add(tomlkit.comment(f"{usual}; instead of it"))
    elif len(rates) > 1:
        table.add("sampling_rate", float(f"{min(known, default=25.0):.6g}"))
        table["sampling_rate"].comment("Hz; guessed: that of the slowest logger")
    else:
        rate = known[0] if known else None
        every = 1 if rate is None or shortest is None else int(shortest * rate / STEPS)
        if rate is not None and shortest is not None and every > 1:
            table.add("sampling_rate", float(f"{rate / every:.6g}"))
            table["sampling_rate"].comment(
                f"Hz; guessed: about {STEPS} samples a wave of {shortest:.3g} s, the shortest"
            )
        else:
            table.add(tomlkit.comment(f"{usual}; left out, the files' own"))
        if not fine:
            said = f"steps_per_period = {STEPS}  # instead: samples a mean period"
            table.add(tomlkit.comment(said))
    gapped = [str(guess.channel) for guess in guesses if guess.gaps]
    if gapped:
        bridged = bool(_waves(guesses)) and not _waves(guesses, whole=True)
        table.add("gaps", "bridge" if bridged else "mask")
        table["gaps"].comment(
            f"{', '.join(gapped)}: 'mask' flags gaps, 'bridge' fills the short ones and says so"
        )
    return table


def _waves(guesses: Sequence[Guess], whole: bool = False) -> list[str]:
    named = [(guess, str(guess.channel)) for guess in guesses if guess.channel]
    return [n for guess, n in named if n.startswith("eta_") and not (whole and guess.gaps)]


def driving_wave(guesses: Sequence[Guess]) -> Guess | None:
    """Wave channel from which the draft takes the encounter period: the model's first input."""
    name = next(iter(_waves(guesses, whole=True) or _waves(guesses)), None)
    return next((guess for guess in guesses if name and guess.channel == name), None)


def model_table(guesses: Sequence[Guess], steps: float | None, holed: Sequence[str] = ()) -> Table:
    """Draft of ``[model]``: motions as states, waves as inputs, delays in encounter periods.

    Parameters
    ----------
    guesses : sequence of Guess
        The channels.
    steps : float or None
        Samples a period of the waves that the preparation makes.
    holed : sequence of str, optional
        What columns would be that miss too much to be channels.

    Returns
    -------
    Table
        The table.
    """
    names = [str(guess.channel) for guess in guesses if guess.channel]
    noise = [str(guess.channel) for guess in guesses if guess.channel and guess.noise]
    whole = [
        str(guess.channel)
        for guess in guesses
        if guess.channel and not guess.gaps and not guess.noise
    ]
    waves = _waves(guesses, whole=True) or _waves(guesses)
    kinds = [MOTIONS, [f"{m}_rate" for m in MOTIONS], [f"{m}_acceleration" for m in MOTIONS]]
    moved = [[name for name in whole if name in kind] for kind in kinds]
    rest = [name for name in whole if not name.startswith("eta_")]
    states = [*moved[0], *moved[1]] or moved[2] or rest or names[:1]
    loads = [name for name in rest if name.startswith("mooring_") and name not in states]
    model = tomlkit.table()
    model.add("preset", "recommended")
    model.add("states", list(states))
    model["states"].comment(
        "guessed: the motions that the model forecasts" if any(moved) else _no_motion(guesses)
    )
    if left := [name for name in noise if any(name in kind for kind in kinds)]:
        model.add(tomlkit.comment(f"{', '.join(left)}: noise alone was found; left out."))
    gapped = [str(guess.channel) for guess in guesses if guess.channel and guess.gaps]
    gapped += holed
    if left := [name for name in gapped if any(name in kind for kind in kinds)]:
        _add_gapped(model, left, "states")
    if loads:
        for line in (
            f"Loads ({', '.join(loads)}) may be added to the states to have them forecast too.",
            "They are left out because a line that goes slack or snaps is not linear, and the",
            "model is: judge their extremes, or compute them from the motions forecast.",
        ):
            model.add(tomlkit.comment(line))
    model.add("inputs", [wave for wave in waves if wave not in states])
    model["inputs"].comment("guessed: the wave probes that drive it; those behind it do not")
    holes = [name for name in holed if name.startswith("eta_")]
    if left := [*(wave for wave in _waves(guesses) if wave not in waves), *holes]:
        _add_gapped(model, left, "inputs")
    model.add(tomlkit.comment("in place of the preset's, in encounter periods T or in samples:"))
    for key, count in (("state_delays", 1), ("input_delays", 5)):
        about = f"  # about {round(count * steps)} samples" if steps is not None else ""
        model.add(tomlkit.comment(f'{key} = "{count} T"{about}'))
    model.add(tomlkit.comment("ridge = 0.15625      # 100/640, with the next line"))
    model.add(tomlkit.comment('ridge_scale = "per_snapshot"'))
    model.add(tomlkit.comment('delay_rows = "exact"'))
    return model


def _add_gapped(model: Table, left: Sequence[str], key: str) -> None:
    has = "it has" if len(left) == 1 else "they have"
    model.add(
        tomlkit.comment(
            f"{', '.join(left)} left out: {has} gaps, and a model takes none. To be among the "
            f"{key}, mend them in the files, or bridge them (gaps, longest_gap in [preparation])."
        )
    )


def _no_motion(guesses: Sequence[Guess]) -> str:
    """What to do where no column is called as a motion is."""
    if all(guess.column.isdigit() for guess in guesses):
        return (
            "CORRECT IT: the files have no header; give [channels.…] their names, such as heave "
            "or eta_1, and state units"
        )
    return "CORRECT IT: no motion was found; name the files of all loggers to init"
