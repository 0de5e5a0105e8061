"""Whole records, and values that a vessel can reach: what prepare warns of and the sheet tells."""

import warnings

import pytest
from small_tank import tank_columns, write_csv

from seakeep.campaign import read_campaign
from seakeep.campaign.checks import findings_of
from seakeep.errors import DataError, RequestError, SeakeepWarning

LOGGERS = """
[instruments]
reference = "probes"

[instruments.probes]

[instruments.mru]

[channels.eta_fwd]
column = "WP fwd"

[channels.heave]
column = "Heave"

[channels.pitch]
column = "Pitch"

[runs.first]
files = { probes = "probes.csv", mru = "mru.csv" }
train = [0, 10]
test = [10, 20]

[preparation]
sampling_rate = 10

[model]
states = ["heave", "pitch"]
inputs = ["eta_fwd"]
"""


@pytest.fixture
def loggers(tmp_path):
    """A run of two loggers; the motions' is written from one instant to another, both in s."""

    def write(begin=0.0, end=20.0, spans=None):
        columns = tank_columns()
        time = columns["Time [s]"]
        write_csv(tmp_path / "probes.csv", {n: columns[n] for n in ("Time [s]", "WP fwd [mm]")})
        kept = (time >= begin) & (time <= end)
        rest = {n: x[kept] for n, x in columns.items() if n != "WP fwd [mm]"}
        write_csv(tmp_path / "mru.csv", rest)
        text = LOGGERS.replace("train = [0, 10]\ntest = [10, 20]", spans or "train = [0, 10]")
        path = tmp_path / "campaign.toml"
        path.write_text(text if spans else LOGGERS, encoding="utf-8")
        return read_campaign(path)

    return write


def records(run):
    return [(each.channel, each.text) for each in findings_of(run) if each.kind == "record"]


class TestRecords:
    def test_a_logger_that_was_cut_off_is_told(self, loggers):
        with pytest.warns(
            SeakeepWarning, match=r"first: mru ends at 15 s, the other loggers at 20"
        ):
            run = loggers(end=15.0).prepare()["first"]
        assert records(run)[0][1].startswith("ends at 15 s, the other loggers at 20 s: the run is")
        assert run.attrs["test_span"] == pytest.approx((10.0, 15.0))

    def test_one_that_begins_late_too(self, loggers):
        with pytest.warns(SeakeepWarning, match=r"mru begins at 3 s, the other loggers at 0 s"):
            run = loggers(begin=3.0).prepare()["first"]
        assert len(records(run)) == 1

    @pytest.mark.parametrize(
        ("ends", "spans"),
        [((0.5, 20.0), None), ((0.0, 19.5), None), ((5.0, 20.0), "span = [6, inf]"),
         ((0.0, 15.0), "train = [1, 8]\ntest = [8, 14]")],
    )  # fmt: skip
    def test_a_start_by_hand_and_what_the_run_does_not_use_do_no_harm(self, loggers, ends, spans):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert not records(loggers(*ends, spans).prepare()["first"])

    @pytest.mark.parametrize("test", ["[10, 20]", "[10, inf]"])
    def test_a_test_part_without_samples_is_an_error(self, loggers, test):
        """It would else be judged on the part that trains."""
        campaign = loggers(end=8.0, spans=f"train = [0, 8]\ntest = {test}")
        message = r"runs\.first\.test: \[10, .*holds 0 sample.* together only from 0 to 8 s"
        with (
            pytest.warns(SeakeepWarning, match="mru ends"),
            pytest.raises(DataError, match=message),
        ):
            campaign.prepare()

    def test_so_is_one_outside_the_run_s_span(self, edited):
        path = edited(("train = [0, 10]", "span = [0, 9]\ntrain = [0, 8]"))
        with pytest.raises(RequestError, match=r"first\.test: \[10, inf\] s holds 0 .* 0 to 9 s"):
            read_campaign(path).prepare(["first"])
