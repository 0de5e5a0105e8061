"""Write each table and key of the campaign file and of the study file, from the settings' own words.

python docs/make_reference.py       # docs/campaign_file.md, and the keys in docs/study.md
"""

import types
import typing
from pathlib import Path

from pydantic_core import PydanticUndefined

from seakeep.campaign.settings import CampaignSettings
from seakeep.study.settings import StudySettings
from seakeep.toml import Table

DOCS = Path(__file__).parent
BEGIN, END = "<!-- keys: written by make_reference.py -->\n", "<!-- end of the keys -->\n"

INTRODUCTION = """# The campaign file

A campaign file (TOML) says once what stands in your files and what is to become of it. This page lists
every table and key. `seakeep init FILE…` drafts one; an unknown key is answered with the nearest known
one. Paths are relative to the file; `${SEAKEEP_DATA_DIR}` and `~` are expanded.

## Which part of a record serves for what

| key of `[runs.NAME]` | what it does |
|---|---|
| `record = [a, b]` | reads this part of the file and nothing else: the way around a gap or a bad end. Filters and derived channels see this part. |
| `span = [a, b]` | is applied last: filters and derived channels have seen the whole record, then the run is cut. Nothing outside is kept, delay history neither. |
| `role` | `"train"`, `"test"` or `"unused"`: what the run, or its span, serves for. |
| `train = [a, b]`, `test = [a, b]` | two parts of one run, instead of `role`. The run is not cut: the delay history of a forecast in the test part may come from before it. |

Times are seconds of the reference's clock; `inf` stands for the end of the record. A channel is
`sign * (reading + offset)`, converted to SI units and radians. Derived channels are computed at the
file's own rate, before the runs are resampled to the common step.

(encounter-periods)=
## Lengths in encounter periods

A number is in seconds, samples or hertz, as the tables below say. Delays, windows and instants may be stated
as a text that counts in encounter periods T̂ instead: `"1.5 T"`. So this campaign trains on sixty periods after
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

T̂ is `encounter_period` of `[campaign]`, or measured: the mean zero-up-crossing period of the wave channel over
the irregular runs, in the part of each run that is used. What that measurement rests on (spans of those runs,
windows of clocks) can count in periods only where `encounter_period` is stated; a message says so. Lengths of
models become samples by rounding to the nearest integer. Priors of ensembles count in periods anyway.

## Loads of lines that fall slack

A linear model cannot follow a load that stops at a floor. A read-out replaces the forecast of such a channel by a
function of what the model forecasts, with hinges max(0, x − q) at six knots q of each of the states that bend it:

```toml
[model.readouts.mooring_stern]
of = ["surge", "heave", "pitch"]
kind = "auto"
```

| `kind` | function of | fitted to |
|---|---|---|
| `"hinge"` | the states in `of` and their hinges | measured states of the training runs |
| `"stacked"` | all forecast states and the hinges of those in `of` | forecasts of each training run by the model of the others, in free runs of 15 T̂ |
| `"auto"` | what held-out runs choose: one of these where it beats no read-out by two standard errors, else none | – |

Neither reads a measurement after the start of a forecast. A load that rests on a floor in the training runs never falls
below their 0.002 quantile; a line that is never slack gets no floor, since the least load of the training says nothing
about higher waves. `readouts = "auto"` asks for this of every channel in newtons, read off the motions among the
states. `seakeep fit` prints the choice, `seakeep tune --vary readouts` writes it into the file. An ensemble
fits its read-outs once, with the medians of its priors, and passes every member through them. A model with read-outs
cannot be exported as a linear system.

## Tables and keys

This part is generated from the settings themselves.
"""


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
    if default is PydanticUndefined:
        return "needed" if field.is_required() else "none"
    if default is None or default == ():
        return "–"
    return f"`{str(default).lower() if isinstance(default, bool) else repr(default)}`"


def rows(table):
    """Rows of the keys of a table."""
    for name, field in table.model_fields.items():
        words = (field.description or "as in the constructor").replace("|", "\\|")
        yield f"| `{field.alias or name}` | {shown(field)} | {words} |"


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
        if table.others is not None:
            queue.insert(0, table.others)
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


PAGES = {"campaign_file.md": campaign_page, "study.md": study_page}

if __name__ == "__main__":
    for name, page in PAGES.items():
        (DOCS / name).write_text(page(), encoding="utf-8")
        print(name)
