"""What a campaign file may say, and the words of the messages where it says something else."""

import pytest
from said import request_error
from small_tank import CAMPAIGN

from seakeep import RequestError, read_campaign


def refusal(path):
    with pytest.raises(RequestError) as caught:
        read_campaign(path)
    return str(caught.value)


# One mistake each: (old text, new text, the line of the message about it).
MISTAKES = [
    (
        'column = "Heave"',
        'colum = "Heave"',
        "channels.heave.colum: unknown key, received 'Heave'. Did you mean 'column'? "
        "Keys here: column, instrument, unit, unit_assumed, sign, offset, accuracy, long_name.",
    ),
    (
        'role = "test"',
        'role = "tset"',
        "runs.second.role: received 'tset', which should be 'train', 'test' or 'unused'. "
        "Give 'train', 'test' or 'unused'.",
    ),
    (
        'file = "second.csv"\n',
        "",
        "runs.second: a run needs either 'file', relative to the campaign file, or 'files', a "
        "table of one file per instrument; received a table with role, span.",
    ),
    (
        "sampling_rate = 10",
        "sampling_rate = -10",
        "preparation.sampling_rate: received -10, which should be greater than 0. "
        "Give samples per second, Hz.",
    ),
    (
        "sampling_rate = 10",
        "sampling_rate = 10\ndt = 0.1",
        "preparation: state only one of sampling_rate, dt; received a table with",
    ),
    (
        "[preparation]",
        '[instruments.mru]\nshared = ["a", "b"]\ndrift = 20\n[preparation]',
        "instruments.mru: drift is found from shared, as offset is: leave drift out; received",
    ),
    (
        "span = [2, 18]",
        "span = [18, 2]",
        "runs.second.span: a span is [start, end] in seconds of the file's clock or in encounter "
        "periods ('10 T'), start before end; 'inf' stands for the end of the record; received",
    ),
    (
        "span = [2, 18]",
        "train = [2, 18]",
        "runs.second: 'role' does not go with 'train' and 'test'; state the role and 'span'",
    ),
    (
        "[runs.second]",
        '[runs."second/run"]',
        "line 35, runs.second/run: the name of a run is made of at most 100 letters, digits",
    ),
    (
        'column = "Heave"',
        'column = "Heave"\nunit = "deg"',
        "channels.heave.unit: the unit 'deg' does not fit heave, which is measured in 'm'. "
        "Correct the unit, or map the column to another channel.",
    ),
    (
        'column = "Heave"',
        'column = "Heave"\nunit = "milimetre"',
        "channels.heave.unit: the unit 'milimetre' is not known.",
    ),
    (
        'states = ["heave", "pitch"]',
        'states = ["heave", "ptich"]',
        "model.states: received 'ptich', no such channel. Did you mean 'pitch'? Channels: "
        "eta_fwd, heave, pitch, acc, pitch_rate.",
    ),
    (
        'states = ["heave", "pitch"]\n',
        "",
        "model.states: missing. Add it: list of channels that the model forecasts.",
    ),
    (
        "eta_fwd = -2.5",
        "eta_fdw = -2.5",
        "rig.positions.eta_fdw: no such channel. Did you mean 'eta_fwd'?",
    ),
    (
        "scale_factor = 30.0",
        'period_channel = "eta_cog"',
        "campaign.period_channel: received 'eta_cog', no such channel.",
    ),
    (
        'from = "pitch"',
        'from = "picth"',
        "derived.pitch_rate.from: the channel 'picth' does not exist. Did you mean 'pitch'?",
    ),
    (
        'step = "differentiate"',
        'step = "derive"',
        "derived.pitch_rate.step: received 'derive', which should be 'integrate', "
        "'differentiate', 'band_pass', 'low_pass', 'envelope_squared', "
        "'complementary_filter', 'transfer' or 'remove_gravity'.",
    ),
    (
        'step = "differentiate"',
        'step = "integrate"',
        "derived.pitch_rate: step 'integrate' needs 'band' (Hz), such as band = [0.3, 5.0]",
    ),
    (
        'step = "differentiate"',
        'step = "differentiate"\nband = [1, 2]',
        "derived.pitch_rate: step 'differentiate' has no key 'band'; remove it",
    ),
    (
        'step = "differentiate"',
        'step = "transfer"\noffset = [-0.6, 0.0]',
        "derived.pitch_rate.offset: received [-0.6, 0.0], a list of the wrong length (2). Give "
        "'transfer': [x, y, z] from the measured",
    ),
    (
        'step = "differentiate"',
        'step = "remove_gravity"\ncomponents = ["a", "b", "c", "d"]',
        "derived.pitch_rate.components: received ['a', 'b', 'c', 'd'], a list of the wrong length "
        "(4). Give 'remove_gravity': accelerometers along x, y and z of the body",
    ),
    (
        'from = "pitch"\nstep = "differentiate"',
        'expression = "2 * ptch"',
        "derived.pitch_rate.expression: the channel 'ptch' does not exist. Did you mean 'pitch'?",
    ),
    (
        'from = "pitch"\nstep = "differentiate"',
        'expression = "pitch.real"',
        "derived.pitch_rate.expression: the expression 'pitch.real' is not allowed: at character 1",
    ),
    (
        'from = "pitch"',
        'expression = "pitch"',
        "derived.pitch_rate: a derived channel needs either 'expression', or 'from' and 'step'",
    ),
    (
        '[derived.pitch_rate]\nfrom = "pitch"\nstep = "differentiate"',
        '[derived.slope]\nexpression = "pitch / 2"',
        "derived.slope.unit: missing. 'slope' is a free name; state the unit of the expression",
    ),
    (
        "[derived.pitch_rate]",
        "[derived.heave]",
        "derived.heave: [channels.heave] exists too. Rename one of them.",
    ),
    (
        "[preparation]",
        "[runs.second.channels.heeve]\nsign = -1\n[preparation]",
        "runs.second.channels.heeve: no table [channels.heeve] to change. Did you mean 'heave'?",
    ),
    (
        "[preparation]",
        '[runs.second.channels.heave]\nunit = "rad"\n[preparation]',
        "runs.second.channels.heave.unit: the unit 'rad' does not fit heave",
    ),
    (
        "[preparation]",
        "[runs]\nthird = 3\n[preparation]",
        "runs.third: received 3, which should be a dictionary or instance of RunSettings. Give at "
        "least one table [runs.NAME] with a file.",
    ),
]


@pytest.mark.parametrize(("old", "new", "line"), MISTAKES)
def test_mistake(edited, old, new, line):
    path = edited((old, new))
    message = refusal(path)
    assert message.startswith(f"{path}: 1 mistake in the campaign file\n  ")
    assert line in message.splitlines()[1]


def test_names_that_no_file_or_variable_can_hold(edited):
    """Names with '/', control characters, or of 300 characters failed after all the work."""
    for name in ("a/b", "a\\u0000b", "x" * 300):
        message = refusal(edited(("[channels.acc]", f'[channels."{name}"]')))
        assert "a name has 1 to 100 characters, not dots alone, and holds no '/'" in message
        message = refusal(edited(("[runs.second]", f'[runs."{name}"]')))
        assert "because files are named after it" in message
    message = refusal(edited(("[runs.second]", "[runs.First]")))
    assert "runs.First: 'first' differs only in the case of its letters, and files" in message
    for name in ("time", "heave_flags"):
        message = refusal(edited(("[channels.acc]", f"[channels.{name}]")))
        assert "a channel is not called 'time', nor does its name end in '_flags'" in message


def test_named_models_are_found_by_their_names(changed):
    campaign = changed(
        ("[model]", "[models.small]"),
        (
            "ridge = 1",
            'ridge = 1\n[models.band]\nkind = "bayesian_hankel_dmdc"\npreset = "recommended"\n'
            'states = ["heave"]\nn_members = 10\nridge = { log_uniform = [0.1, 1] }',
        ),
    )
    band = campaign.model("band")
    assert band.inputs == ()
    assert band.arguments() == {"ridge": {"log_uniform": (0.1, 1)}, "n_members": 10}
    with request_error(r"no table \[models\.bnad\]\. Did you mean 'band'\? Named models: s"):
        campaign.model("bnad")
    with request_error(r"no table \[model\]\. Name one of small, band\."):
        campaign.model()


def test_a_campaign_without_a_model_says_so(changed):
    with request_error(r"no table \[model\]\. Add \[model\] with 'states'"):
        changed((CAMPAIGN[CAMPAIGN.index("[model]") :], "")).model()
