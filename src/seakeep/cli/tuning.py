"""``seakeep tune``."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields, replace
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
from seakeep.toml import Length

if TYPE_CHECKING:
    from seakeep.models import HankelDMDc, ProbeAlignment, ReadOut
    from seakeep.models.observables import Observable
    from seakeep.tuning import TuneResult

__all__ = ["tune"]

PLAIN = ("preset", "ridge_scale", "delay_rows", "readouts")
"""Keys of a tuned file that go with a choice, and tables: no comment says where they come from."""


def tune(
    campaign: CampaignFile,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            help="What to choose beside the ridge: observables, lead, input_delays, state_delays, "
            "rank, alignment, readouts. Repeat it for several. Default: observables, which are "
            "chosen too where the file leaves them open.",
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
    from seakeep.models import HankelDMDc, Select, labelled
    from seakeep.report.comparison import plain_cells
    from seakeep.study.fit import read_training
    from seakeep.study.resolve import counts_in_periods, preset_of
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
    if settings.kind != "hankel_dmdc":
        raise RequestError(
            f"kind = '{settings.kind}' cannot be tuned: a Hankel model is. Name another model with "
            "--model, or set kind = 'hankel_dmdc'. An ensemble chooses by itself: preset = "
            "'recommended'."
        )
    with progress_bar("Preparing") as progress:
        spec, _, runs, stop = read_training(read, model, progress)
    assert isinstance(spec, HankelDMDc)
    period = read.encounter_period() if counts_in_periods(settings) else None
    kept = target.with_suffix(".scores.json")
    chosen = spec.select or Select(period=period)
    varied = {*(vary or ["observables"]), *(["observables"] if chosen.observables else [])}
    with member_executor(workers, scheduler) as executor, progress_bar("Tuning") as progress:
        found = search(
            replace(spec, select=chosen),
            runs,
            list(settings.states),
            list(settings.inputs),
            vary=sorted(varied),
            horizon=chosen.horizon,
            folds=chosen.folds,
            stop=stop,
            executor=executor,
            progress=progress,
            resume=kept,
        )
    typer.echo(found.describe())
    text = _tuned(
        campaign.read_text(encoding="utf-8"),
        model,
        found,
        varied,
        preset_of(settings),
        period if period is None else period / labelled.common_step(runs),
    )
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


def _tuned(
    text: str,
    model: str | None,
    found: TuneResult,
    varied: Collection[str],
    preset: str | None,
    period: float | None,
) -> str:
    """The campaign file with the choice in the table of the model, and nothing else changed.

    `preset` is what the table takes, stated or not, and `period` the encounter period in samples,
    where the campaign has one.
    """
    import tomlkit

    document = tomlkit.parse(text)
    table: Any = document["model"] if model is None else document["models"][model]
    # Blank lines and comments there belong to the next table, if this one is in one place.
    between = _after(table) if isinstance(table, tomlkit.items.Table) else []
    values = _choice(found.spec, table, varied, preset, period)
    stale = {"select", "rank"}  # nothing is left to be chosen
    stale |= ({"alignment"} & set(varied)) | ({"readouts"} & set(values)) | {"preset"} - set(values)
    for key in stale:
        table.pop(key, None)
    for key, value in values.items():
        if table.get(key) == value:
            continue
        table[key] = value
        if key not in PLAIN:
            table[key].comment("chosen by seakeep tune, by free runs on held-out training runs")
    if between:
        _end(table).extend(between)
    first = "# seakeep_file: tuned campaign\n"
    body = tomlkit.dumps(document)
    return body if body.startswith(first) else first + body


def _choice(
    spec: HankelDMDc,
    table: Mapping[str, Any],
    varied: Collection[str],
    preset: str | None,
    period: float | None,
) -> dict[str, Any]:
    """Keys of the table of a model that state the choice, and the preset that it goes with."""
    values: dict[str, Any] = {"ridge": spec.ridge, "ridge_scale": spec.ridge_scale}
    stated = set(varied)
    if preset is not None and "alignment" in varied and spec.alignment is None:
        # The preset may bring an alignment, so that all which it states is stated in its place.
        stated |= {"readouts", "state_delays", "input_delays", "lead"}
        values["delay_rows"] = spec.delay_rows
    elif preset is not None:
        values["preset"] = preset
    for key in ("state_delays", "input_delays", "lead"):
        if key in stated:
            count = int(getattr(spec, key))
            values[key] = count if isinstance(table.get(key), int) else _in_periods(count, period)
    if spec.rank is not None:
        values["rank"] = spec.rank
    if "observables" in stated:
        values["observables"] = _observables(spec.observables)
    if "alignment" in stated and spec.alignment is not None:
        values["alignment"] = _alignment(spec.alignment)
    if "readouts" in stated:
        values["readouts"] = "auto" if spec.readouts == "auto" else _readouts(spec.readouts)
    return values


def _observables(chosen: Sequence[Observable]) -> Any:
    """A list of tables, a line for each."""
    import tomlkit

    from seakeep.models.observables import to_json

    rows = tomlkit.array()
    for each in chosen:
        row = tomlkit.inline_table()
        made: Any = each  # mypy takes no Protocol for a dataclass
        defaults = {field.name: field.default for field in fields(made)}
        for key, value in to_json(each).items():
            if key == "kind" or getattr(each, key) != defaults[key]:
                row[key] = value
        rows.append(row)
    return rows.multiline(bool(chosen))


def _in_periods(samples: int, period: float | None) -> int | str:
    """A number of samples as a file states it: in periods, which hold at any sampling rate."""
    if period is None:
        return samples
    lengths = (Length(float(f"{samples / period:.{digits}g}")) for digits in range(2, 16))
    return str(next(each for each in lengths if round(each.at(period)) == samples))


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
