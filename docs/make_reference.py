"""Write the reference pages: tables and keys of files, commands, and the contents of the API.

python docs/make_reference.py   # campaign_file.md, and the keys in study.md; a build makes the others
"""

import dataclasses
import importlib
import inspect
import re
import types
import typing
from pathlib import Path

import typer
from pydantic_core import PydanticUndefined

from seakeep.campaign.settings import (
    CampaignSettings,
    InstrumentSettings,
    InstrumentsSettings,
    ModelSettings,
)
from seakeep.cli import app
from seakeep.models import BayesianHankelDMDc, HankelDMDc, ProbeAlignment, Select
from seakeep.study.settings import StudySettings
from seakeep.toml import Table

DOCS = Path(__file__).parent
BEGIN, END = "<!-- keys: written by make_reference.py -->\n", "<!-- end of the keys -->\n"

INTRODUCTION = """# The campaign file

A campaign file (TOML) describes your files, how to prepare them, and the models to identify. This page lists
every table and key. `seakeep init FILE…` drafts a campaign file. For an unknown key, a message proposes the nearest known
one. Paths are relative to the file; `${SEAKEEP_DATA_DIR}` and `~` are expanded.

## Parts of a record

| key of `[runs.NAME]` | effect |
|---|---|
| `record = [a, b]` | Only this part of the file is read, for example to avoid a gap or a bad end. Filters and derived channels see this part. |
| `span = [a, b]` | The run is cut to this part last, after filters and derived channels. Nothing outside is kept, not even delay history. |
| `role` | `"train"`, `"test"` or `"unused"`: the use of the run, or of its span. |
| `train = [a, b]`, `test = [a, b]` | Two parts of one run, instead of `role`. The run is not cut: the delay history of a forecast in the test part may come from before it. |

Times are in seconds on the reference clock; `inf` stands for the end of the record. A channel is
`sign * (reading + offset)`, converted to SI units and radians. Derived channels are computed at the
file's own rate, before the runs are resampled to the common step.

(encounter-periods)=
## Lengths in encounter periods

A number is in seconds, samples or hertz, as the tables below say. Delays, windows and instants may instead be stated
in encounter periods T̂, as text: `"1.5 T"`. For example, this campaign trains on sixty periods after
the tenth and delays the input by five periods:

```toml
[campaign]
encounter_period = 1.64

[preparation]
steps_per_period = 32

[runs.slow]
file = "slow.csv"
train = ["10 T", "70 T"]
test = ["70 T", inf]

[model]
state_delays = "1 T"
input_delays = "5 T"
```

T̂ is `encounter_period` of `[campaign]`. If that is not stated, T̂ is measured: the mean zero-up-crossing period of the wave
channel over the irregular runs (all with waves if none is), in the used part of each run; runs of fewer than ten waves
have no part in it where others hold more. Test runs count too: another test file changes T̂, and with it the step of
`steps_per_period` and all lengths in periods. State `encounter_period` to keep them: where a model was fitted with another step, the error names the period that restores it. The keys on which this measurement depends (spans of those runs, windows of
clocks) can be in periods only if `encounter_period` is stated; a message says so. Lengths of models are rounded to the nearest number of samples; they may be in seconds too (`"0.5 s"`), and bare numbers count samples.

## Priors

In an ensemble (`kind = "bayesian_hankel_dmdc"`) `window`, `state_delays`, `input_delays` and `ridge` may be priors, from
which the settings of each member are drawn:

| prior | draws |
|---|---|
| `{ uniform = ["10 T", "30 T"] }` | uniform between two bounds |
| `{ log_uniform = [0.1, 10] }` | uniform in the logarithm |
| `{ distribution = "norm", parameters = { loc = 15, scale = 1 }, unit = "T" }` | a distribution of `scipy.stats`; `unit` is that of a length, `"T"` or `"s"`, and samples without it |

## Observables

Observables are further inputs, computed from the measured ones. `recommended` chooses among them; to state them, list
tables:

```toml
[model]
observables = [
    { kind = "slow_squares", of = "eta_cog" },
    { kind = "powers", of = ["eta_fwd", "eta_cog"], powers = [2, 3] },
    { kind = "expression", name = "wind_force", expression = "wind * abs(wind)", units = "m^2/s^2" },
]
```

| `kind` | keys and defaults | columns |
|---|---|---|
| `"slow_squares"` | `of`; `orders = [0, 1, 2]` of the derivatives; `cutoff = "0.333 /T"`; `lead = "2 T"`; `lags = ["0 T", …, "5 T"]` | slow parts of the squares of elevations and their derivatives, which drive drift |
| `"powers"` | `of`; `powers = [2, 3]` | powers of inputs, with the input delays, which steep waves need |
| `"expression"` | `name`, `expression`, `units = ""` | an expression of inputs, with the input delays |

`cutoff`, `lead` and `lags` count in encounter periods, with or without `T`.

## Loads of lines

A linear model cannot follow a load that depends on how deep its line is in the water. A read-out replaces the forecast of
such a channel by a ridge regression on the motions among the states and their rates, hinges of the surge, and elevation and
rate of the wave at one place, the line's:

```toml
[model.readouts]
mooring_bow = "wave"
mooring_stern = "auto"
```

| kind | |
|---|---|
| `"wave"` | the regression, fitted to measured motions; the place is the one that errs least on training runs left out in turn |
| `"auto"` | the same where free runs on held-out runs gain two standard errors and 2 % by it, else none |

The waves are carried to the line by the filters of an alignment with `surge = "predicted"`, without which `"wave"` is refused
and `"auto"` takes none. It reads no measured state after the start of a forecast. On tanks whose lines feel
the wave it takes 3 to 15 % off the errors of the loads in irregular waves; in steep regular ones it gains nothing
(`benchmarks/results/wet_lines.md`). Where motions or wave leave the range of
training, the forecast of the load as a state takes over. If the load rests on a floor in a hundredth of the training
samples or more, its forecast does not fall below their 0.002 quantile, with either kind and with none. A line that is never slack in
training gets no floor, since it may fall slack in higher waves. `readouts = "auto"` applies `"auto"` to every channel in newtons. `seakeep fit` prints the choice, and `seakeep tune --vary readouts` writes it into the file. An ensemble
fits its read-outs once, with the medians of its priors, and applies them to every member. A model with read-outs
cannot be exported as a linear system.

## Tables and keys

This part is generated from the settings themselves.
"""


PARAMETER = re.compile(r"^    (\w+(?:,\s+\w+)*)(?: : (.*))?$", re.MULTILINE)
OF_MODELS = {
    HankelDMDc: "`kind = 'hankel_dmdc'`",
    BayesianHankelDMDc: "`kind = 'bayesian_hankel_dmdc'`",
    ProbeAlignment: "`alignment`, a table",
    Select: "`select`, a table",
}


def tables_of(annotation):
    """Settings classes inside an annotation, in order."""
    if isinstance(annotation, type) and issubclass(annotation, Table):
        return [annotation]
    if typing.get_origin(annotation) in (typing.Annotated, dict, typing.Union, types.UnionType):
        return [table for part in typing.get_args(annotation) for table in tables_of(part)]
    return []


def shown(field):
    """Default of a key in words."""
    default = field.default
    if field.is_required():
        return "needed"
    if default in (PydanticUndefined, {}):
        return "none"
    if default is None or default == ():
        return "–"
    return f"`{str(default).lower() if isinstance(default, bool) else repr(default)}`"


def rows(table):
    """Rows of the keys of a table."""
    for name, field in table.model_fields.items():
        words = " ".join((field.description or "").split()).replace("|", "\\|")
        yield f"| `{field.alias or name}` | {shown(field)} | {words} |"


def documented(spec):
    """Rows of the arguments of a model, from its docstring, which must describe all of them."""
    section = spec.__doc__.split("----------\n", 1)[1].split("\n    Raises\n")[0]
    parts = PARAMETER.split(section)[1:]
    defaults = {each.name: each.default for each in dataclasses.fields(spec) if each.init}
    for names, kind, text in zip(parts[::3], parts[1::3], parts[2::3], strict=True):
        words = re.sub(r":\w+:`~?([^`]*)`", r"`\1`", " ".join(text.split())).replace("``", "`")
        kinds = (kind or "").removesuffix(", optional")
        for name in re.split(r",\s+", names):
            default = defaults.pop(name)
            value = "–" if default in (None, ()) else f"`{default}`"
            value = "needed" if default is dataclasses.MISSING else value
            meaning = f"{kinds}: {words}" if kinds else words
            yield f"| `{name}` | {value} | {meaning} |".replace("||", "\\|\\|")
    if defaults:
        raise ValueError(f"the docstring of {spec.__name__} lacks {', '.join(defaults)}")


def text_of(table):
    """First paragraph of a class's docstring."""
    return " ".join((table.__doc__ or "").split("\n\n")[0].split())


def keys_of(settings):
    """Lines of all tables that a file of these settings may have, one after the other."""
    lines = []
    queue = [
        table for field in settings.model_fields.values() for table in tables_of(field.annotation)
    ]
    done = []
    while queue:
        table = queue.pop(0)
        if table in done:
            continue
        done.append(table)
        lines += [f"### {table.__name__.removesuffix('Settings')}", "", text_of(table), ""]
        lines += ["| key | default | meaning |", "|---|---|---|", *rows(table), ""]
        for spec, words in OF_MODELS.items() if table is ModelSettings else ():
            lines += [f"Keys of {words}:", ""]
            lines += ["| key | default | meaning |", "|---|---|---|", *documented(spec), ""]
        if table is InstrumentsSettings:
            queue.insert(0, InstrumentSettings)
        for field in table.model_fields.values():
            queue += tables_of(field.annotation)
    return lines


def campaign_page():
    """The whole page of the campaign file."""
    return "\n".join([INTRODUCTION, *keys_of(CampaignSettings)]).rstrip() + "\n"


def study_page():
    """The page of the study as it is written, with its keys anew."""
    before, _, rest = (DOCS / "study.md").read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    return before + BEGIN + "\n" + "\n".join(keys_of(StudySettings)) + "\n" + END + after


COMMANDS = """# Commands

This page lists all commands with their options; `--help` of a command prints the same. Results go to standard output or to `-o`, messages to standard error. The exit status is 0 if
all is done, 1 if the run failed, 2 if the request is wrong, and 130 after Ctrl-C. `seakeep --debug COMMAND …` shows the
traceback of an error. `seakeep --install-completion` completes commands and options with the Tab key in bash, zsh, fish
and PowerShell; `--show-completion` prints what it would install.

This page is generated from the commands themselves.
"""


def option_row(parameter, hint):
    """Row of an argument or an option, from its annotation."""
    kind, info = typing.get_args(hint)[:2]
    while parts := typing.get_args(kind):  # list[str] | None is text
        kind = parts[0] if typing.get_origin(kind) is not typing.Literal else str
    metavar = info.metavar or ("TEXT" if kind is str else kind.__name__.upper())
    if isinstance(info, typer.models.ArgumentInfo):
        name = info.metavar or parameter.name.upper()
    else:
        named = [each for each in (info.default, *(info.param_decls or ())) if type(each) is str]
        named = named or ["--" + parameter.name.strip("_").replace("_", "-")]
        name = ", ".join(named) + ("" if kind is bool else f" {metavar}")
    default = parameter.default
    stated = "" if default in (None, False, inspect.Parameter.empty) else f" Default: `{default}`."
    return f"| `{name}` | {(info.help or '').replace('|', chr(92) + '|')}{stated} |"


def commands_of(typer_app, before=""):
    """Names and functions of all commands, those of groups too."""
    for group in typer_app.registered_groups:
        inside = group.typer_instance
        name = f"{before}{group.name or inside.info.name}"
        if callback := inside.registered_callback:
            yield name, inside.info.help, callback.callback
        yield from commands_of(inside, f"{name} ")
    for command in typer_app.registered_commands:
        function = command.callback
        yield before + (command.name or function.__name__), function.__doc__, function


def commands_page():
    """Each command with its help, its example and its options."""
    lines = [COMMANDS]
    for name, words, function in sorted(commands_of(app), key=lambda each: each[0]):
        lines += [f"## seakeep {name}", ""]
        for paragraph in inspect.cleandoc(words).split("\n\n"):
            words = " ".join(paragraph.split())
            before, mark, example = words.partition(": seakeep ")
            if mark and len(before) < 40:
                lines += [f"{before}:", "", "```sh", f"seakeep {example}", "```", ""]
            else:
                lines += [words, ""]
        hints = typing.get_type_hints(function, include_extras=True)
        rows = [
            option_row(each, hints[each.name])
            for each in inspect.signature(function).parameters.values()
            if typing.get_origin(hints[each.name]) is typing.Annotated
        ]
        if rows:
            lines += ["| argument or option | meaning |", "|---|---|", *rows, ""]
    return "\n".join(lines).rstrip() + "\n"


ROOMS = (
    *("seakeep", "seakeep.models", "seakeep.baselines", "seakeep.campaign", "seakeep.quality"),
    *("seakeep.formats", "seakeep.signals", "seakeep.metrics", "seakeep.statistics"),
    *("seakeep.study", "seakeep.check", "seakeep.plot", "seakeep.hosts", "seakeep.core"),
    *("seakeep.waves", "seakeep.conventions", "seakeep.errors"),
)
"""Modules of the API, each object in the first that names it."""

API = """# Python API

This page lists the public functions and classes, with one page each. All of them check their arguments: a wrong request
raises a `RequestError`, wrong data a `DataError`, with a message that says what was received and how to fix it. Arrays are
`(time, channel)`.

This page is generated from the public names of each module.
"""


def api_objects():
    """Public functions and classes of each room, in the first room that names them."""
    known = set()
    for room in ROOMS:
        module = importlib.import_module(room)
        found = {name: getattr(module, name) for name in sorted(module.__all__, key=str.lower)}
        own = {
            name: each
            for name, each in found.items()
            if (inspect.isclass(each) or inspect.isroutine(each)) and id(each) not in known
        }
        known |= {id(each) for each in own.values()}
        if own:
            yield module, own


def first_line(text):
    """First paragraph of a docstring in Markdown."""
    words = " ".join(inspect.cleandoc(text or "").split("\n\n")[0].split())
    return re.sub(r":(math|class|func|meth):`~?([^`]*)`", r"`\2`", words).replace("``", "`")


def api_page():
    """Contents of the API."""
    lines = [API]
    for module, found in api_objects():
        lines += [f"## {module.__name__}", "", first_line(module.__doc__), ""]
        for name, each in found.items():
            lines.append(
                f"- [`{name}`](api/{module.__name__}.{name}.md): {first_line(each.__doc__)}"
            )
        lines.append("")
    return "\n".join(lines).rstrip() + "\n"


def api_pages():
    """One page per object; outside the navigation, which would hold hundreds of entries."""
    for module, found in api_objects():
        for name, each in found.items():
            whole = f"{module.__name__}.{name}"
            kind = "exception" if inspect.isclass(each) and issubclass(each, Exception) else "class"
            kind = kind if inspect.isclass(each) else "function"
            members = "\n   :members:" * (kind == "class")
            if kind == "class" and each.__module__.startswith("seakeep.models"):
                members += "\n   :inherited-members: Enum, Protocol"
            text = f"---\norphan: true\n---\n\n# {whole}\n\n[API](../api.md)\n\n"
            body = f"```{{eval-rst}}\n.. auto{kind}:: {whole}{members}\n```\n"
            yield f"api/{whole}.md", text + body


PAGES = {"campaign_file.md": campaign_page, "study.md": study_page}


def generated():
    """Name and text of each page that a build writes."""
    yield "commands.md", commands_page()
    yield "api.md", api_page()
    yield from api_pages()


if __name__ == "__main__":
    for name, page in PAGES.items():
        (DOCS / name).write_text(page(), encoding="utf-8")
        print(name)
