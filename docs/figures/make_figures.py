"""Draw the figures of the documentation and of the measured examples.

    python docs/figures/make_figures.py indices     # docs/figures/indices.svg and .png
    python docs/figures/make_figures.py instants    # docs/figures/instants.svg
    python docs/figures/make_figures.py recursion   # docs/figures/recursion.svg
    python docs/figures/make_figures.py in_service  # docs/figures/in_service.png
    python docs/figures/make_figures.py tutorial    # docs/figures/unseen.png and band.png
    python docs/figures/make_figures.py study       # the tutorial's study report; needs Chromium
    python docs/figures/make_figures.py tank        # the virtual tank's; extras tank and video
    python docs/figures/make_figures.py check       # docs/figures/check_*.png; extra tank
    python docs/figures/make_figures.py chain       # docs/figures/quality_sheet.png; extra tank
    python docs/figures/make_figures.py ntnu sjtu   # examples/*/figures; need SEAKEEP_DATA_DIR

Figures of results are drawn small and in few colours, so that the repository stays light.
"""

import contextlib
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from PIL import Image

import seakeep
from seakeep.report.figures.histories import overlay_figure
from seakeep.report.sections import write_report
from seakeep.report.style import figure_style, save_figure
from seakeep.study import compare, fit_campaign, in_degrees, read_study, run_study

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
EXAMPLES = ROOT / "examples"

# --- the index picture ---------------------------------------------------------------------------
S, Z, M, STEPS = 3, 6, 10, 7
READ = {"facecolor": "#4D4D4D", "edgecolor": "black"}
WRITTEN = {"facecolor": "#F6B26B", "edgecolor": "black", "hatch": "////"}
AHEAD = {"facecolor": "#B8CBE0", "edgecolor": "black", "hatch": "..."}
WINDOW = {"facecolor": "#DDDDDD", "edgecolor": "black"}
ONLY_HISTORY = {"facecolor": "white", "edgecolor": "black", "hatch": "xxxx"}
IDLE = {"facecolor": "white", "edgecolor": "#AAAAAA"}


def cell(axes, at, row, style, text="", colour="black"):
    """One sample of a series: a square at column `at`."""
    axes.add_patch(Rectangle((at - 0.44, row - 0.44), 0.88, 0.88, linewidth=0.8, **style))
    if text:
        axes.text(at, row, text, ha="center", va="center", fontsize=9, color=colour)


def brace(axes, first, last, row, text, above=True):
    """A bracket over (or under) the samples `first` to `last`."""
    sign = 1 if above else -1
    left, right, tip = first - 0.42, last + 0.42, row + 0.18 * sign
    axes.plot([left, left, right, right], [row, tip, tip, row], color="black", linewidth=1.0)
    axes.text(
        0.5 * (first + last),
        tip + 0.1 * sign,
        text,
        ha="center",
        va="bottom" if above else "top",
        fontsize=10.5,
    )


def panel(axes, title, height):
    """Prepare a panel that is 25 cells wide."""
    axes.set_xlim(-5.5, 19.9)
    axes.set_ylim(0.0, height)
    axes.set_aspect("equal")
    axes.axis("off")
    axes.text(-5.3, height - 0.1, title, fontsize=12, fontweight="bold", va="top")


def label(axes, row, text):
    axes.text(-1.0, row, text, ha="right", va="center", fontsize=10.5)


def index_name(letter, shift):
    return f"${letter}{shift:+d}$".replace("+0", "").replace("-", "{-}") if shift else f"${letter}$"


def draw_pair(axes):
    """One snapshot pair of the regression."""
    panel(axes, "1   One column of the regression:  x̂(j+1) ≈ Â x̂(j) + B̂ û(j)", 5.4)
    j = 9
    for at in range(1, 12):
        shift = at - j
        axes.text(at, 3.45, index_name("j", shift), ha="center", va="center", fontsize=9)
        state = READ if -S <= shift <= 0 else WRITTEN if shift == 1 else IDLE
        cell(axes, at, 2.65, state)
        cell(axes, at, 1.55, READ if -Z <= shift <= 0 else IDLE)
    label(axes, 2.65, "states  x")
    label(axes, 1.55, "inputs  u")
    brace(axes, j - S, j, 3.8, f"x̂(j): s + 1 samples  (here s = {S})")
    brace(axes, j - Z, j, 0.95, f"û(j): z + 1 samples  (here z = {Z})", above=False)
    axes.text(j + 3.0, 2.65, "x(j+1): the first N rows of x̂(j+1)", fontsize=10.5, va="center")
    axes.text(j + 3.0, 1.55, "u(j+1) has no part in it", fontsize=10.5, va="center")


def draw_window(axes):
    """The training window with the history before it and inside it."""
    title = f"2   Training window: the last m snapshots up to and including stop  (here m = {M})"
    panel(axes, title, 6.1)
    reach, first = max(S, Z), 7
    last = first + M - 1
    for row, place in ((3.6, "before"), (1.5, "inside")):
        label(axes, row, f'history="{place}"')
        start = first if place == "before" else first + reach
        for at in range(20):
            style = WINDOW if first <= at <= last else IDLE
            if place == "before" and first - reach <= at < first:
                style = ONLY_HISTORY
            cell(axes, at, row, style)
            if start <= at < last:
                axes.plot(at, row, "o", color="black", markersize=7)
        words = "m − 1" if place == "before" else "m − 1 − max(s, z)"
        brace(axes, start, last - 1, row - 0.55, f"{words} = {last - start} columns", above=False)
    brace(axes, first, last, 4.2, "the window: mean and SD are taken over its m samples")
    brace(axes, first - reach, first - 1, 3.05, "max(s, z) samples", above=False)
    axes.text(last, 2.55, "stop", ha="center", va="center", fontsize=11, fontweight="bold")
    for ends in ((2.8, 3.1), (2.0, 2.3)):
        axes.plot([last, last], ends, color="black", linewidth=1.4)


def draw_forecast(axes):
    """What a forecast reads and writes."""
    panel(axes, f"3   Forecast from start = instant k  (here steps = {STEPS})", 6.0)
    k = 8
    for at in range(18):
        shift = at - k
        axes.text(at, 3.75, index_name("k", shift), ha="center", va="center", fontsize=9)
        state = READ if -S <= shift <= 0 else WRITTEN if 0 < shift <= STEPS else IDLE
        given = READ if -Z <= shift <= 0 else AHEAD if 0 < shift < STEPS else IDLE
        cell(axes, at, 2.95, state)
        cell(axes, at, 1.85, given)
    label(axes, 2.95, "states  x")
    label(axes, 1.85, "inputs  u")
    brace(axes, k - max(S, Z), k, 4.1, "history_samples = max(s, z) + 1")
    brace(axes, k + 1, k + STEPS, 4.1, "written: x(k+1) … x(k+steps)")
    brace(axes, k + 1, k + STEPS - 1, 1.25, "read: u(k+1) … u(k+steps−1)", above=False)
    axes.plot([k + 0.5] * 2, [0.55, 4.35], color="black", linewidth=1.4, linestyle=(0, (4, 2)))
    axes.text(k + 0.35, 0.65, "start", ha="right", va="center", fontsize=11, fontweight="bold")


def draw_key(axes):
    """What the fills mean."""
    panel(axes, "", 2.3)
    entries = (
        (-4.6, 1.7, READ, "measured, read"),
        (2.2, 1.7, AHEAD, "measured input after the start, read"),
        (12.8, 1.7, WRITTEN, "target, or forecast"),
        (-4.6, 0.6, WINDOW, "training window"),
        (2.2, 0.6, ONLY_HISTORY, "read as delays only, not in mean and SD"),
        (12.8, 0.6, IDLE, "not read"),
    )
    for at, row, style, text in entries:
        cell(axes, at, row, style)
        axes.text(at + 0.75, row, text, fontsize=10, va="center")
    axes.plot(16.6, 0.6, "o", color="black", markersize=7)
    axes.text(17.1, 0.6, "a column j", fontsize=10, va="center")


def indices():
    """The one picture of all indices."""
    heights = [5.4, 6.1, 6.0, 2.3]
    with mpl.rc_context(
        {"svg.fonttype": "path", "svg.hashsalt": "seakeep", "hatch.linewidth": 0.7}
    ):
        figure = Figure(figsize=(10.0, 10.0 * sum(heights) / 25.4))
        bottom = 1.0
        for height, draw in zip(
            heights, (draw_pair, draw_window, draw_forecast, draw_key), strict=True
        ):
            part = height / sum(heights)
            bottom -= part
            draw(figure.add_axes((0.0, bottom, 1.0, part)))
        figure.savefig(HERE / "indices.svg", metadata={"Date": None})
        save(figure, HERE / "indices.png")


# --- the instants of a model in service ----------------------------------------------------------
MISSING = {"facecolor": "white", "edgecolor": "black", "linestyle": ":"}
ESTIMATED = {"facecolor": "#9CC3E5", "edgecolor": "black"}


def instants():
    """Which instants a live model has read, estimates and forecasts."""
    with mpl.rc_context(
        {"svg.fonttype": "path", "svg.hashsalt": "seakeep", "hatch.linewidth": 0.7}
    ):
        figure = Figure(figsize=(10.0, 10.0 * 6.4 / 25.4))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        panel(axes, "after live.step(u, y) of instant k, with a look-ahead of 3 samples", 6.4)
        rows = {"inputs u": 4.0, "states y": 2.9, "state estimates": 1.8}
        for text, row in rows.items():
            label(axes, row, text)
        for at in range(8):
            missing = at in (2, 6)
            cell(axes, at, rows["inputs u"], READ)
            cell(axes, at, rows["states y"], MISSING if missing else READ)
            cell(axes, at, rows["state estimates"], ESTIMATED)
            axes.text(at, 4.75, index_name("k", at - 7), ha="center", fontsize=9)
        for at in range(8, 18):
            cell(axes, at, rows["inputs u"], MISSING)
            axes.text(at, 4.75, index_name("k", at - 7), ha="center", fontsize=9)
            if at < 16:
                cell(axes, at, rows["state estimates"], WRITTEN)
        axes.plot([7.5, 7.5], [1.2, 5.1], color="black", lw=1.2, ls="--")
        axes.text(7.6, 5.2, "live.time", fontsize=10, ha="center")
        brace(axes, 0, 5, 1.25, "final", above=False)
        brace(axes, 6, 7, 1.25, "mended as\nwaves arrive", above=False)
        brace(axes, 8, 15, 1.25, "live.forecast(8)", above=False)
        words = "dotted: not measured. Inputs to come are given as future, or predicted"
        axes.text(8.0, 2.9, words, fontsize=9.5, va="center")
        figure.savefig(HERE / "instants.svg", metadata={"Date": None})


def recursion():
    """What one step of a model that follows its own surge reads."""
    with mpl.rc_context(
        {"svg.fonttype": "path", "svg.hashsalt": "seakeep", "hatch.linewidth": 0.7}
    ):
        figure = Figure(figsize=(10.0, 10.0 * 7.6 / 25.4))
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        panel(axes, "the step from j to j+1, with a look-ahead of 3 samples", 7.6)
        rows = {"probes": 5.2, "waves carried": 4.0, "surge": 2.4, "states": 1.2}
        for text, row in rows.items():
            label(axes, row, text)
        for at in range(13):
            axes.text(at, 5.95, index_name("j", at - 8), ha="center", fontsize=9)
            cell(axes, at, rows["probes"], READ if at < 12 else IDLE)
            cell(axes, at, rows["waves carried"], AHEAD if 2 <= at <= 8 else IDLE)
            cell(axes, at, rows["surge"], WINDOW if 4 <= at <= 8 else IDLE)
            cell(axes, at, rows["states"], WRITTEN if at == 9 else READ if 5 <= at <= 8 else IDLE)
        for at in range(12):
            axes.plot([at, 8], [rows["probes"] - 0.4, 4.45], color="#888888", lw=0.6)
        axes.annotate("", (8, 3.55), (8, 2.85), arrowprops={"arrowstyle": "->", "lw": 1.2})
        words = {
            "probes": "filters of all probes,\nfor places on a grid",
            "waves carried": "read between the two places\nbeside the vessel",
            "surge": "the place: a sum\nof the last surges",
            "states": "the next states; then\nall moves on by one",
        }
        for row, text in words.items():
            axes.text(13.2, rows[row], text, fontsize=9.5, va="center")
        figure.savefig(HERE / "recursion.svg", metadata={"Date": None})


def in_service():
    """A minute without a sensor, as the example plays it."""
    campaign = ROOT / "docs" / "tutorial" / "campaign.toml"
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "model.nc"
        fit_campaign(seakeep.read_campaign(campaign)).save(model)
        script = [sys.executable, EXAMPLES / "in_service" / "play.py"]
        out = HERE / "in_service.png"
        subprocess.run([*script, model, campaign, "unseen", "heave", out], check=True)


# --- figures of results --------------------------------------------------------------------------
def save(figure, path):
    path.parent.mkdir(parents=True, exist_ok=True)
    save_figure(figure, path)
    print(f"{path.relative_to(ROOT)}  {path.stat().st_size / 1000:.0f} kB")


def overlays(campaign_file, model, runs, folder, prefix=""):
    """Forecast over measurement of some runs, as `seakeep compare` draws it."""
    campaign = seakeep.read_campaign(campaign_file)
    identified = fit_campaign(campaign, model)
    for each in compare(identified, campaign, runs):
        save(overlay_figure({"": in_degrees(each)}), folder / f"{prefix}{each.run}.png")


def tutorial():
    """The tutorial's unseen run, and the ensemble's band around its highest wave."""
    file = ROOT / "docs" / "tutorial" / "campaign.toml"
    overlays(file, None, [], HERE)
    campaign = seakeep.read_campaign(file)
    ensemble = fit_campaign(campaign, "ensemble")
    (around,) = compare(ensemble, campaign, start=60.0, steps=200)
    save(overlay_figure({"": in_degrees(around)}), HERE / "band.png")


def study():
    """Top of the report of the tutorial's study, as a browser shows it, and one of its figures."""
    browsers = ("chromium", "chromium-browser", "google-chrome")
    browser = next((found for name in browsers if (found := shutil.which(name))), None)
    if browser is None:
        sys.exit(f"no browser: install one of {', '.join(browsers)}")
    asked = read_study(ROOT / "docs" / "tutorial" / "study.toml")
    with tempfile.TemporaryDirectory() as folder:
        page = write_report(run_study(asked, Path(folder) / "study"))
        shot = Path(folder) / "report.png"
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"]
        size = ["--window-size=1200,1000", f"--screenshot={shot}"]
        subprocess.run([browser, *options, *size, page.as_uri()], check=True, capture_output=True)
        with Image.open(shot) as picture:
            picture.convert("RGB").quantize(32).save(HERE / "report.png", optimize=True)
        shutil.copy(page.parent / "figures" / "error_over_time.png", HERE / "report_age.png")


def ntnu():
    """Motions, sway and tensions of the ship section's test runs."""
    folder = EXAMPLES / "ntnu_ship_section"
    file, figures = folder / "campaign.toml", folder / "figures"
    overlays(file, None, ["3041_2", "3061_2", "3102_3"], figures, "motions_")
    overlays(file, "sway", ["3061_2", "3102_3"], figures, "sway_")
    overlays(file, "tensions", ["3041_2", "3102_3"], figures, "tensions_")
    overlays(file, "tensions_paper", ["3102_3"], figures, "tensions_paper_")


def sjtu():
    """Heave of the semi-submersible."""
    file, figures = (EXAMPLES / "sjtu_semisub" / name for name in ("campaign.toml", "figures"))
    overlays(file, None, ["Data01"], figures)
    overlays(file, "paper", ["Data01"], figures, "paper_")


def tank():
    """Coefficients, spectrum, a run and a video frame of the virtual tank."""
    sys.path.insert(0, str(ROOT / "benchmarks"))
    from tank_figures import hydrodynamics_figure, realise, run_figure, tank_spectrum_figure

    from seakeep.signals.tracking import opencv
    from seakeep.tank.play import check_settings, play_run, side_view, truth
    from seakeep.tank.settings import default_settings

    settings = default_settings()
    rig = check_settings(settings)
    played = {name: play_run(settings, name, rig) for name in settings.runs}
    measured = [realise(each, name) for name, each in played.items()]
    save(hydrodynamics_figure(rig, settings), HERE / "tank_hydrodynamics.png")
    save(tank_spectrum_figure(settings, measured), HERE / "tank_spectrum.png")
    channels = ["eta_kn_fwd", "surge", "heave", "pitch", "piston", "mooring_bow", "mooring_stern"]
    run = truth(played["irregular_1"], "irregular_1", 0.05)
    save(run_figure(run, channels), HERE / "tank_run.png")
    cv2 = opencv("drawing a frame")
    frame = next(side_view(played["irregular_1"], np.random.default_rng(0), [88.8]))
    small = cv2.resize(frame, (640, 360), interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(HERE / "tank_side_view.jpg"), small, [cv2.IMWRITE_JPEG_QUALITY, 85])


def chain():
    """A part of the data-quality sheet, by the example of the measurement chain's page."""
    from seakeep.campaign.pipeline import redundant_pairs
    from seakeep.quality import compared
    from seakeep.report.figures.histories import quality_figure
    from seakeep.tank.play import play
    from seakeep.tank.settings import default_settings

    page = (ROOT / "docs" / "measurement_chain.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", page, flags=re.M | re.S)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        play(default_settings(), Path("virtual"), names=("irregular_1", "regular_2"))
        faults = next(block for block in blocks if "file.write" in block)
        exec(compile(faults, "measurement_chain.md", "exec"), {"Path": Path})  # the page is ours
        campaign = seakeep.read_campaign("virtual/campaign.toml")
        run = campaign.prepare(["irregular_1"])["irregular_1"]
        period = run.attrs.get("encounter_period", float("nan"))
        pairs = compared(run, redundant_pairs(campaign.settings, period))
        agreements = {channel: each for (channel, _), each in pairs.items()}
    shown = run[["eta_us_fwd", "heave", "heave_of_acceleration"]].assign_attrs(run.attrs)
    with figure_style():  # all colours, unlike `save`: a palette would take those of single marks
        quality_figure(shown, agreements).savefig(HERE / "quality_sheet.png", dpi=90)


CHECKED = """
[models.checked]
preset = "recommended"
states = [
    "surge", "heave", "pitch", "surge_rate", "heave_rate", "pitch_rate", "mooring_bow",
    "mooring_stern",
]
inputs = ["eta_fwd", "eta_cog"]
"""


def check():
    """What a recommended model of the virtual tank is worth; seed 0."""
    from seakeep.tank.play import play
    from seakeep.tank.settings import default_settings

    with tempfile.TemporaryDirectory() as folder:
        play(default_settings(), Path(folder) / "virtual")
        file = Path(folder) / "virtual" / "campaign.toml"
        file.write_text(file.read_text(encoding="utf-8") + CHECKED, encoding="utf-8")
        campaign = seakeep.read_campaign(file)
        draw_checks(fit_campaign(campaign, "checked"), campaign.prepare())


def draw_checks(model, runs):
    """Pictures of the page on checks."""
    measured = seakeep.check.measured_response(model, runs)
    motions = ["surge", "heave", "pitch"]
    plots, checks = seakeep.plot, seakeep.check
    response = checks.response(model, None, runs).sel(state=motions)
    drift = checks.drift(model, runs).sel(state=[*motions[:1], "mooring_bow"])
    figures = {
        "response": plots.response(response, measured.sel(state=motions)),
        "coherence": plots.coherence(checks.coherence(model, runs).sel(state=motions)),
        "exceedance": plots.exceedance(checks.statistics(model, runs).sel(state=motions)),
        "drift": plots.drift(drift),
    }
    for name, figure in figures.items():
        save(figure, HERE / f"check_{name}.png")


DRAWINGS = {
    each.__name__: each
    for each in (
        indices,
        instants,
        recursion,
        in_service,
        tutorial,
        study,
        ntnu,
        sjtu,
        tank,
        check,
        chain,
    )
}

if __name__ == "__main__":
    for wanted in sys.argv[1:] or ["indices"]:
        DRAWINGS[wanted]()
