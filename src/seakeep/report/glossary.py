"""Words and symbols of a study's report, said once."""

from __future__ import annotations

import re

from seakeep.conventions import canonical_channel
from seakeep.report.figures.boxes import FEWEST
from seakeep.study import StudyResult

__all__ = ["few_cells", "glossary", "plain_symbol"]

_LETTERS = {r"\theta": "θ", r"\phi": "φ", r"\psi": "ψ", r"\eta": "η"}
_ACCENTS = {"dot": "\N{COMBINING DOT ABOVE}", "ddot": "\N{COMBINING DIAERESIS}"}


def plain_symbol(channel: str) -> str:
    """Symbol of a channel as figures print it, in plain letters; its name where it has none.

    Examples
    --------
    >>> plain_symbol("mooring_bow"), plain_symbol("heave"), plain_symbol("torque")
    ('M_bow', 'z', 'torque')
    """
    known = canonical_channel(channel)
    if known is None:
        return channel.replace("_", " ")
    text = re.sub(r"\\mathrm\{([^}]*)\}|\\mathrm ?(\w+)", r"\1\2", known.symbol)
    for tex, letter in _LETTERS.items():
        text = text.replace(tex, letter)
    return re.sub(r"\\(d?dot)\{(\w)\}", lambda m: m[2] + _ACCENTS[m[1]], text)


def _explained(result: StudyResult, channel: str) -> str:
    """Symbol and words of a channel; once where they are the same."""
    symbol, words = plain_symbol(channel), result.words_of(channel)
    return words if symbol == words else f"{symbol} {words}"


def few_cells(result: StudyResult) -> str:
    """Sentence where a test set has too few cells for its statistics; else empty.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    str
    """
    counts = {test: int(data["judged"].sum()) for test, data in result.tests.items()}
    small = [f"{result.label_of(test)}: n = {n}" for test, n in counts.items() if n < FEWEST]
    if not small:
        return ""
    return (
        f"Few cells ({'; '.join(small)}): medians, quartiles and differences between models say "
        f"little below about {FEWEST}. Ask for more training or test windows before a conclusion."
    )


def glossary(result: StudyResult) -> list[tuple[str, str]]:
    """Terms and symbols with what they mean.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    list of (str, str)
    """
    period = float(result.attrs["encounter_period"])
    symbols = "; ".join(_explained(result, name) for name in result.channels)
    loads = any(name.startswith("mooring_") for name in result.channels)
    regular = any(f"statistics/response/{test}" in result.groups for test in result.tests)
    same = (
        " It is that of the irregular sea and counts lengths in regular waves too, so that a "
        "window of 5 T̂ may hold more or fewer regular waves than five."
    )
    terms = [
        ("cell", "one training set × one test window: one forecast of each model"),
        ("judged", "counted: not a cell whose run was learnt from, nor a channel that hardly "
         "moves in the window"),
        ("T̂", f"mean encounter period, {period:.3f} s; lengths are counted in it."
         + (same if regular else "")),
        ("NRMSE, ANRMSE", "root mean square error over the measured SD of the window; ANRMSE: "
         "averaged over the channels"),
        ("NAMMAE", "mean absolute error of the smallest and the largest value in the window, over "
         "k measured SDs, k = 1; of all channels: their average"),
        ("SD, IQR", "standard deviation; inter-quartile range, upper quartile − lower quartile"),
        ("HDMDc, BHDMDc", "Hankel dynamic mode decomposition with control: a linear model with "
         "delays; its ensemble over hyperparameters, here 'Bayesian'"),
        ("EV, U", "of a bootstrapped divergence: mean, and q0.975 − q0.025"),
        ("ε(t)", "absolute error at an age of the forecast, averaged over the channels, in "
         "measured SDs"),
        ("in figures", symbols + (". M is a mooring load, a force in N." if loads else "")),
    ]  # fmt: skip
    if regular:
        terms.append(("λ/L", "length of the regular waves over that of the vessel"))
    if any("truth" in data for data in result.tests.values()):
        terms.append(
            (
                "slap",
                "decaying pulses in a load, as its line dips into the water and out",
            )
        )
    return terms
