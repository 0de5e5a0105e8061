"""``seakeep tune``."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from seakeep.cli.console import messages, progress_bar
from seakeep.cli.options import (
    CampaignFile,
    ModelKey,
    Scheduler,
    Workers,
    member_executor,
    read_files,
)
from seakeep.errors import RequestError
from seakeep.files import check_output, check_place, replacing

if TYPE_CHECKING:
    from seakeep.models import ProbeAlignment, ReadOut
    from seakeep.tuning import TuneResult

__all__ = ["tune"]


def tune(
    campaign: CampaignFile,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            help="What to choose beside the ridge: observables, lead, input_delays, state_delays, "
            "rank, alignment, readouts. Repeat it for several. Default: observables.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", help="Tuned campaign file, beside CAMPAIGN. Default: NAME_tuned.toml."
        ),
    ] = None,
    model: ModelKey = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Choose settings by free runs on held-out training runs.

    Each candidate is fitted to all training runs but one and judged by free runs on that one.
    The choice is written into a copy of the campaign file, and all that was tried into a CSV file
    beside it. After an interruption, the same command continues the search.

    Example: seakeep tune docs/tutorial/campaign.toml --vary input_delays
    """
    from seakeep.campaign import read_campaign
    from seakeep.models import HankelDMDc, Select
    from seakeep.report.comparison import plain_cells
    from seakeep.study.fit import read_training
    from seakeep.tuning import tune as search

    read = read_campaign(campaign)
    target = out or campaign.with_name(f"{campaign.stem}_tuned.toml")
    if target.resolve().parent != campaign.resolve().parent:
        raise RequestError(
            f"{target} lies in another folder than {campaign}, and paths in the file count from "
            "its folder. Write it beside the campaign file."
        )
    check_place(target, ".toml")
    picture, tried = target.with_suffix(".png"), target.with_suffix(".csv")
    for path, kind in ((target, "tuned campaign"), (picture, "figure"), (tried, "table")):
        check_output(path, kind, read_files(read), "state_delays,input_delays,lead,observables,")
    settings = read.model(model)
    with progress_bar("Preparing") as progress:
        spec, _, runs, stop = read_training(read, model, progress)
    if not isinstance(spec, HankelDMDc):
        raise RequestError(
            f"kind = '{settings.kind}' cannot be tuned: a Hankel model is. Name another model with "
            "--model, or set kind = 'hankel_dmdc'."
        )
    kept, varied = target.with_suffix(".scores.json"), vary or ["observables"]
    chosen = spec.select or Select()
    with member_executor(workers, scheduler) as executor, progress_bar("Tuning") as progress:
        found = search(
            spec,
            runs,
            list(settings.states),
            list(settings.inputs),
            vary=varied,
            horizon=chosen.horizon,
            folds=chosen.folds,
            stop=stop,
            executor=executor,
            progress=progress,
            resume=kept,
        )
    typer.echo(found.describe())
    text = _tuned(campaign.read_text(encoding="utf-8"), model, found, varied)
    with replacing(target) as place:
        place.write_text(text, encoding="utf-8")
    kept.unlink(missing_ok=True)
    messages().print(f"Wrote {target}. Fit it with: seakeep fit {target} -o model.nc")
    if not found.table.sizes["trial"]:
        return
    with replacing(tried) as place:
        plain_cells(found.table.to_dataframe()).to_csv(place, index=False)
    messages().print(f"Wrote {tried}: all that was tried.")
    if find_spec("matplotlib"):
        from seakeep.report.style import save_figure

        messages().print(f"Wrote {save_figure(found.figure(), picture)}.")


def _tuned(text: str, model: str | None, found: TuneResult, varied: Sequence[str]) -> str:
    """The campaign file with the choice in the table of the model, and nothing else changed."""
    import tomlkit

    from seakeep.models.observables import to_json

    document = tomlkit.parse(text)
    table: Any = document["model"] if model is None else document["models"][model]
    spec = found.spec
    values: dict[str, Any] = {
        "state_delays": spec.state_delays,
        "input_delays": spec.input_delays,
        "lead": spec.lead,
        "delay_rows": spec.delay_rows,
        "ridge": spec.ridge,
        "ridge_scale": spec.ridge_scale,
    }
    tables = tomlkit.array()
    for each in spec.observables:
        row = tomlkit.inline_table()
        row.update({k: v for k, v in to_json(each).items() if v not in (None, "")})
        tables.append(row)
    values["observables"] = tables.multiline(bool(spec.observables))
    # Blank lines and comments there belong to the next table, if this one is in one place.
    between = _after(table) if isinstance(table, tomlkit.items.Table) else []
    table.pop("rank", None)
    if spec.rank is not None:
        values["rank"] = spec.rank
    for key, value in values.items():
        table[key] = value
    stated = set(varied)
    if "alignment" in varied:
        table.pop("alignment", None)
        if spec.alignment is not None:
            table["alignment"] = _alignment(spec.alignment)
        elif table.pop("preset", None):  # which may bring an alignment, and read-outs
            stated.add("readouts")
    if "readouts" in stated:
        table.pop("readouts", None)
        table["readouts"] = "auto" if spec.readouts == "auto" else _readouts(spec.readouts)
    if between:
        _end(table).extend(between)
    table["ridge"].comment("chosen by seakeep tune, by free runs on held-out training runs")
    first = "# seakeep_file: tuned campaign\n"
    body = tomlkit.dumps(document)
    return body if body.startswith(first) else first + body


def _alignment(chosen: ProbeAlignment) -> Any:
    """The keys of an alignment that differ from their defaults, mode and surge always."""
    import tomlkit

    default = type(chosen)().to_json()
    row = tomlkit.inline_table()
    for key, value in chosen.to_json().items():
        if key in ("mode", "surge") or value != default[key]:
            row[key] = value
    return row


def _end(table: Any) -> list[Any]:
    """Keys and items, lines without a key too, of the table that stands last inside a table."""
    body: list[Any] = table.value.body
    last: Any = next((item for key, item in reversed(body) if key is not None), None)
    if hasattr(last, "is_aot") and last.is_aot():
        last = last[-1]
    return _end(last) if hasattr(last, "is_table") and last.is_table() else body


def _after(table: Any) -> list[Any]:
    """Take off the lines without a key at the end of a table."""
    body = _end(table)
    count = next((n for n, (key, _) in enumerate(reversed(body)) if key is not None), len(body))
    lines = body[len(body) - count :]
    del body[len(body) - count :]
    return lines


def _readouts(chosen: Sequence[ReadOut]) -> Any:
    """Tables ``[model.readouts.NAME]``; an empty one says that none is wanted."""
    import tomlkit

    tables = tomlkit.table(is_super_table=True) if chosen else tomlkit.inline_table()
    for each in chosen:
        row = tomlkit.table()
        row.update({"kind": each.kind, "of": list(each.of)})
        tables[each.channel] = row
    return tables
