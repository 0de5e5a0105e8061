"""Write docs/campaign_file.md: each table and key of a campaign file, from the settings' own words.

python docs/make_campaign_reference.py
"""

import types
import typing
from pathlib import Path

from pydantic_core import PydanticUndefined

from seakeep.campaign.settings import CampaignSettings
from seakeep.campaign.tables import Table

PAGE = Path(__file__).with_name("campaign_file.md")

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

Times are seconds of the file's own clock; `inf` stands for the end of the record. A channel is
`sign * (reading + offset)`, converted to SI units and radians. Derived channels are computed at the
file's own rate, before the runs are resampled to the common step.

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


def page():
    """The whole page."""
    lines = [INTRODUCTION]
    queue = [
        table
        for field in CampaignSettings.model_fields.values()
        for table in tables_of(field.annotation)
    ]
    done = []
    while queue:
        table = queue.pop(0)
        if table in done:
            continue
        done.append(table)
        lines += [f"### {table.__name__.removesuffix('Settings')}", "", text_of(table), ""]
        lines += ["| key | default | meaning |", "|---|---|---|", *rows(table), ""]
        for field in table.model_fields.values():
            queue += tables_of(field.annotation)
    return "\n".join(lines).rstrip() + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE.name)
