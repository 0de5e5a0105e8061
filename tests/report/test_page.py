"""The report of a study: complete, self-contained, and at work in a real browser."""

import base64
import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from near import assert_near
from numpy.testing import assert_allclose
from tables import rows_of
from tutorial_study import STUDY, put_tutorial, studied

from seakeep.files import check_report
from seakeep.report.sections.results import (
    _tested,
    bands,
    coverage_table,
    divergence_table,
    findings,
    summary,
)
from seakeep.report.tables import WORDS
from seakeep.study import read_result

pytest.importorskip("matplotlib")


from seakeep.report.figures.errors import average_boxes, error_over_time_figure
from seakeep.report.figures.histories import history_figure, shown_cells
from seakeep.report.page import Drawing, Section, write_page
from seakeep.report.sections import write_report
from seakeep.report.sections.data import waves
from seakeep.report.sections.histories import MISSING, histories

CHANNELS = 'states = ["heave", "pitch", "heave_rate"]\ninputs = ["eta_fwd", "eta_mid"]'
NAMED = STUDY.replace("seed = 3", CHANNELS).replace("length = 6", 'length = 6\nlabel = "a & b < c"')


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    put_tutorial(folder, NAMED)
    return write_report(studied(folder))


@pytest.fixture(scope="module")
def result(page):
    """The result of that study, read once; tests that change it replace its parts."""
    return read_result(page.parent)


def cells_of(page, name):
    """Cells of a CSV file of the report, without its head."""
    return [list(row.values()) for row in rows_of(page.parent / "tables" / f"{name}.csv")]


def changed(result, groups=(), **settings):
    """The same study with other groups and settings."""
    attrs = {**result.attrs, "settings": json.dumps({**result.settings, **settings})}
    return replace(result, attrs=attrs, groups={**result.groups, **dict(groups)})


def without(result, group):
    return replace(result, groups={k: v for k, v in result.groups.items() if k != group})


def test_the_page_holds_its_parts_and_names_nothing_outside_itself(page, result):
    text = page.read_text("utf-8")
    addresses = re.findall(r"""(?:src|href)\s*=\s*["']([^"']*)["']""", text)
    assert addresses
    beside = [each for each in addresses if not each.startswith(("#", "data:"))]
    assert all(each.startswith(("figures/", "tables/", "histories/")) for each in beside)
    assert all((page.parent / each).exists() for each in beside)
    # What is left of addresses are names of XML, which nobody fetches.
    assert all("www.w3.org" in each for each in re.findall(r"https?://[^\s\"'<>]*", text))
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    wanted = ["summary", "errors", "explore", "densities", "settings", "versions", "words"]
    assert [each for each in re.findall(r'<section id="(.*?)">', text) if each in wanted] == wanted
    for part in ("a &amp; b &lt; c", "noise floor", result.attrs["digest"], "<dt>EV, U</dt>"):
        assert part in text
    assert "θ pitch; z\u0307 heave rate" in text
    (when,) = re.findall(r'finished\s<span class="whole">(.*?)</span>', text)
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d UTC", when)


def test_figures_and_tables_are_files_too(page):
    figures = {path.name for path in (page.parent / "figures").iterdir()}
    for name in ("errors_unseen", "densities_bayesian", "error_over_time", "eigenvalues"):
        assert {f"{name}.png", f"{name}.svg"} <= figures
    bands = [row[1] for row in cells_of(page, "trend")]
    assert bands == [f"{k} frequencies" for k in ("all", "low", "wave") for _ in range(2)]
    settings = {(model, key): told for model, key, *told in cells_of(page, "models")}
    assert settings["Bayesian", "window"] == ["uniform, 10 to 20 T̂", "stated"]
    assert settings["deterministic", "delay rows"] == ["exact", "preset"]
    assert settings["deterministic", "window"] == ["all samples", "default"]
    for path in (page.parent / "tables").glob("*.tex"):
        text = path.read_text("utf-8")
        assert r"\toprule" in text
        # What pdfLaTeX prints without further packages.
        assert {each for each in text if ord(each) > 127} <= set("äöüßÄÖÜéèêçÂÅåøØæ"), path


def test_the_calibrated_band_has_a_table_and_says_what_it_rests_on(page, result):
    average = result.groups["statistics/coverage"].sel(
        test="unseen", model="bayesian", band="calibrated", against="measured", channel="average"
    )
    expected = [average["inside"], average["relative_width"]]
    row = cells_of(page, "coverage_calibrated_bayesian")[-1]
    assert row == ["average", *(f"{float(value):.2f}" for value in expected)]
    windows = result.groups["calibration"]["windows"].sel(ensemble="bayesian").values
    assert f"A training set had {windows.min()}" in page.read_text("utf-8")
    plain = coverage_table(result, "bayesian", "calibrated").note
    assert "not made for" not in plain
    assert "infinite" not in plain
    tests = result.settings["tests"]
    tests = {**tests, "long": {**tests["unseen"], "length": 12.0, "label": ""}}
    table = result.groups["statistics/coverage"]
    table = xr.concat([table, table.assign_coords(test=["long"])], "test")
    groups = {"statistics/coverage": table, "tests/long": result.groups["tests/unseen"]}
    note = coverage_table(changed(result, groups, tests=tests), "bayesian", "calibrated").note
    assert "Those are 6 T̂ long; the margin is not made for long (12 T̂)" in note
    margins = result.groups["calibration"]
    endless = margins["margin"].where(margins["training"] != "t00", np.inf)
    found = changed(result, {"calibration": margins.assign(margin=endless)})
    words = "The calibrated band is infinite in 3 of 6 cases (training set × channel; t00)"
    assert words in coverage_table(found, "bayesian", "calibrated").note
    assert words in " ".join(findings(found))
    assert [words in each.note for each in bands(found).tables] == [False, False, True, True]


def test_a_history_shows_the_calibrated_band_around_that_of_the_members(result):
    ((test, training, window), *_) = shown_cells(result)
    figure = history_figure(result, test, training, window)
    cell = result.tests[test].isel(training=training, window=window)
    kept = result.groups["calibration"].sel(ensemble="bayesian").isel(training=training)
    for axes, name in zip(figure.axes, result.channels, strict=True):
        one = cell.sel(channel=name, model="bayesian", ensemble="bayesian")
        at = kept.sel(channel=name)
        (lower,) = (line for line in axes.lines if line.get_label() == "calibrated")
        wider = one["mean"] - at["margin"] * np.hypot(one["std"], at["floor"])
        expected = (wider - one["training_mean"]) / one["training_std"]
        assert_allclose(lower.get_ydata(), expected, rtol=1e-10)
    plain = history_figure(without(result, "calibration"), test, training, window)
    for drawn, shown in ((figure, True), (plain, False)):
        texts = [text.get_text() for text in drawn.legends[0].get_texts()]
        assert ("calibrated" in texts) == shown


def test_the_published_divergences_stand_beside_a_study_that_asks_for_them(result):
    columns = divergence_table(result, "bayesian", "paper").columns
    assert not any("paper" in each for each in columns)
    asked = changed(result, output={**result.settings["output"], "paper": True})
    table = divergence_table(asked, "bayesian", "paper")
    assert table.columns[-4:] == ("paper: EV", "paper: q0.025", "paper: q0.975", "paper: U")
    published = WORDS["published"]
    assert [row[-4:] for row in table.rows if row[0] == "heave"] == [tuple(published["heave"])]


def test_a_report_that_was_interrupted_is_written_again(tmp_path):
    def interrupted():
        raise KeyboardInterrupt

    stamp = {"description": "Words.", "finished": ""}
    section = Section("drawn", "Drawn", figures=(Drawing("lines", "Lines", interrupted),))
    with pytest.raises(KeyboardInterrupt):
        write_page(tmp_path, "Title", stamp, (section,))
    (tmp_path / "figures" / "lines.png").touch()
    check_report(tmp_path)  # raises nothing: the folder is ours
    assert "not finished" in (tmp_path / "report.html").read_text("utf-8")
    write_page(tmp_path, "Title", stamp, ())
    assert "not finished" not in (tmp_path / "report.html").read_text("utf-8")


@pytest.fixture(scope="module")
def browser():
    """A Chromium of the system, without a window, that logs all it complains of."""
    webdriver = pytest.importorskip("selenium.webdriver")
    chromium = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
    driver = shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("chromium and chromedriver are not on PATH (Debian: chromium chromium-driver)")
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service

    options = Options()
    options.binary_location = chromium
    size = "--window-size=1300,1000"
    for each in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        size,
    ):
        options.add_argument(each)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    started = webdriver.Chrome(options=options, service=Service(driver))
    yield started
    started.quit()


def test_the_time_histories_zoom_and_choose(browser, page):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.support.ui import Select, WebDriverWait

    def state(key):
        return browser.execute_script(f"return document.getElementById('history').dataset.{key}")

    def shown():
        """Ends of the part of the time that is shown."""
        return [float(each) for each in state("range").split()]

    def told_at(element):
        """Words beside the time histories, with the mouse on an element."""
        ActionChains(browser).move_to_element(element).perform()
        return browser.find_element("id", "history-readout").text

    browser.get(page.as_uri())
    canvas = browser.find_element("id", "history")
    whole = shown()
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", canvas)
    browser.find_element("css selector", "[data-act='+']").click()
    low, high = shown()
    assert high - low < 0.7 * (whole[1] - whole[0])
    browser.find_element("css selector", "[data-act=ArrowRight]").click()
    assert shown()[0] > low
    drag = ActionChains(browser).move_to_element_with_offset(canvas, -100, 0)
    drag.click_and_hold().move_by_offset(150, 0).release().perform()
    assert shown() != whole
    ActionChains(browser).double_click(canvas).perform()
    assert shown() == whole
    assert state("channel") == "heave"
    Select(browser.find_element("id", "pick-channel")).select_by_index(1)
    assert state("channel") == "pitch"
    opening = state("cell")
    for place in ("pick-window", "pick-training"):  # each in a file that is loaded now
        before = state("cell")
        Select(browser.find_element("id", place)).select_by_index(1)
        WebDriverWait(browser, 10).until(lambda _, old=before: state("cell") != old)
    for place in ("pick-training", "pick-window"):
        Select(browser.find_element("id", place)).select_by_index(0)
    assert state("cell") == opening
    told = told_at(browser.find_element("tag name", "h1"))
    assert re.search(r"NRMSE of pitch in this window: deterministic \d\.\d{3}, Bayesian mean", told)
    assert state("legend").split(", ") == [
        "Bayesian band", "measured", "deterministic", "Bayesian mean"
    ]  # fmt: skip
    told = told_at(canvas)
    assert re.search(r"measured -?[\d.e-]+ deg", told)
    assert re.search(r"wave elevation.* m\b", told)
    assert browser.get_log("browser") == []


def test_cells_of_the_time_histories_are_the_forecasts_in_degrees(page, result):
    script = (page.parent / "histories" / "unseen-1.js").read_text("utf-8")
    cells = json.loads(script.removeprefix('seakeepCells["unseen-1"]=').removesuffix(";\n"))
    at = result.tests["unseen"].isel(training=1, window=2)
    bands = at.sel(ensemble="bayesian")
    cell, bayesian = cells["2"], cells["2"]["models"]["bayesian"]
    parts = [
        (cell["measured"], at["measured"]),
        (cell["models"]["deterministic"]["mean"], at["mean"].sel(model="deterministic")),
        (bayesian["mean"], at["mean"].sel(model="bayesian")),
        (bayesian["lower"], bands["lower"]),
        (bayesian["upper"], bands["upper"]),
    ]
    for packed, values in parts:
        for channel, factor in {"heave": 1.0, "pitch": np.rad2deg(1.0)}.items():
            each = packed[result.channels.index(channel)]
            codes = np.frombuffer(base64.b64decode(each["data"]), "<u2")
            step = (each["high"] - each["low"]) / (MISSING - 1)
            assert_near(each["low"] + step * codes, factor * values.sel(channel=channel), step)
    assert_near(bayesian["nrmse"], at["error"].sel(model="bayesian", measure="nrmse"), 0.0005)


def test_a_dollar_in_a_label_starts_no_formula(result):
    named = changed(result, tests={"unseen": {"label": "1 $_ or 2 $"}})
    (tick,) = average_boxes(named, ["unseen"]).axes[0].get_xticklabels()
    assert tick.get_text() == r"1 \$_ or 2 \$"
    assert error_over_time_figure(named).axes[0].get_ylabel().startswith(r"1 \$_ or 2 \$")


def test_inputs_that_are_no_waves_have_no_table_and_no_spectrum_of_them(result):
    section = waves(without(result, "spectra"))
    assert [each.name for each in section.tables] == ["positions"]
    assert not section.figures


def test_lost_forecasts_are_named(result):
    cell = {"model": "m", "test": "unseen", "training": "t0", "window": 1, "run": "r", "start": 2.0}
    lost = xr.Dataset({key: ("cell", [value]) for key, value in cell.items()})
    notices = summary(changed(result, {"statistics/lost": lost})).notices
    (notice,) = (text for text in notices if "1 forecast(s) diverged" in text)
    assert "window 1 of 'unseen' (r from 2 s)" in notice


def test_training_sets_that_no_window_judges_are_not_counted(result):
    assert "from 2 training sets and run freely" in _tested(result)
    judged = result.tests["unseen"]["judged"] & (result.tests["unseen"]["training"] == "t01")
    one = {"tests/unseen": result.tests["unseen"].assign(judged=judged)}
    assert "from 1 training set and run freely" in _tested(changed(result, one))
    more = changed(
        result,
        {**one, "tests/again": result.tests["unseen"]},
        tests={"unseen": {"label": "first"}, "again": {"label": "again"}},
    )
    assert re.search(r"from 2 training sets .*T̂, models of 1 set\), again \(3", _tested(more))


def test_captions_name_an_ensemble_where_there_is_one_and_hold_no_mark_up(page, result):
    single = replace(result, attrs={**result.attrs, "models": json.dumps(
        {name: {**of, "ensemble": False} for name, of in result.model_settings.items()}
    )})  # fmt: skip
    for each, has_band in ((result, True), (single, False)):
        captions = [figure.caption for figure in histories(each).figures]
        assert captions
        assert ["ensemble" in caption for caption in captions] == [has_band] * len(captions)
    assert "`" not in re.sub("(?s)<script.*?</script>", "", page.read_text("utf-8"))
