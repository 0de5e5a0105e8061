"""From a TOML file to settings, with one message that names every mistake in it."""

from collections.abc import Iterable, Mapping

from seakeep.campaign.derivation import needed_channels, sources_of
from seakeep.campaign.settings import CampaignSettings, ChannelSettings, DerivedSettings, units_of
from seakeep.conventions import canonical_channel, conversion
from seakeep.errors import RequestError, did_you_mean
from seakeep.toml import Mistake, in_seconds, lengths


def cross_checks(settings: CampaignSettings) -> Iterable[Mistake]:
    """What tables of a campaign say against one another."""
    yield from _unit_mistakes(settings)
    yield from _derived_mistakes(settings)
    yield from _name_mistakes(settings)
    wave = settings.campaign.period_channel
    if wave is None or wave in settings.channel_names:
        yield from _period_mistakes(settings)
    known = list(settings.instruments.loggers)
    used = {logger for run in settings.runs.values() for logger in run.files}
    reference = settings.instruments.reference
    if reference is not None and reference not in {*known, *used}:
        near = did_you_mean(reference, sorted(used))
        words = f"received {reference!r}, which no run has a file of.{near}"
        yield ("instruments", "reference"), words
    for run, each in settings.runs.items():
        for logger in each.files:
            if known and logger not in known:
                yield (
                    ("runs", run, "files", logger),
                    f"no table [instruments.{logger}].{did_you_mean(logger, known)} "
                    f"Instruments: {', '.join(known)}.",
                )
    spelt: dict[str, str] = {}
    for run, each in settings.runs.items():
        if (other := spelt.setdefault(run.lower(), run)) != run:
            yield (
                ("runs", run),
                f"'{other}' differs only in the case of its letters, and files are named after "
                "both. Rename one.",
            )
        for name in each.channels:
            if name not in settings.channels:
                yield (
                    ("runs", run, "channels", name),
                    f"no table [channels.{name}] to change.{did_you_mean(name, settings.channels)} "
                    "Add it there first.",
                )


def span_mistakes(settings: CampaignSettings, period: float) -> Iterable[Mistake]:
    """Spans of which one end counts in periods, and which run backwards with a period (s)."""
    for run, each in settings.runs.items():
        spans = {"record": each.record, "span": each.span, "train": each.train, "test": each.test}
        for key, span in spans.items():
            if span is None:
                continue
            start, end = (in_seconds(edge, period) for edge in span)
            if not start < end:
                yield (
                    ("runs", run, key),
                    f"received [{span[0]}, {span[1]}], which with an encounter period of "
                    f"{period:.6g} s is [{start:g}, {end:g}]. State the lower one first.",
                )


def _name_mistakes(settings: CampaignSettings) -> Iterable[Mistake]:
    """Names of channels that the campaign has no channel of."""
    names = settings.channel_names
    wanted: list[tuple[tuple[str, ...], str]] = [
        (("rig", "positions", name), name) for name in settings.rig.positions
    ]
    if settings.campaign.period_channel is not None:
        wanted.append((("campaign", "period_channel"), settings.campaign.period_channel))
    for table, model in settings.all_models().items():
        place = tuple(table.split(".", 1))
        wanted += [((*place, key), n) for key in ("states", "inputs") for n in getattr(model, key)]
    for key, pair in settings.redundant.items():
        wanted += [(("redundant", key, "channels"), name) for name in pair.channels]
    for place, name in wanted:
        if name not in names:
            received = "" if place[-1] == name else f"received {name!r}, "
            near = did_you_mean(name, names)
            yield place, f"{received}no such channel.{near} Channels: {', '.join(names)}."


def _period_mistakes(settings: CampaignSettings) -> Iterable[Mistake]:
    """Keys in encounter periods where there is no period, or where it is measured with them."""
    places = list(lengths(settings))
    wave, stated = settings.wave_channel, settings.campaign.encounter_period
    if stated:
        yield from span_mistakes(settings, stated)
    if not places or stated:
        return
    if wave is None:
        yield (
            places[0],
            "counts in encounter periods, and the campaign has none. State encounter_period (s) or "
            "period_channel in [campaign], or name a channel eta_…",
        )
        return
    for place in places:
        head, name, *_ = place
        if (head == "runs" and name in settings.period_runs) or head == "instruments":
            yield (
                place,
                "counts in encounter periods, and the period is measured with it, as the "
                f"zero-up-crossing period of {wave}. State encounter_period (s) in [campaign], or "
                "this in seconds.",
            )


def _unit_mistakes(settings: CampaignSettings) -> Iterable[Mistake]:
    tables: dict[tuple[str, ...], Mapping[str, ChannelSettings | DerivedSettings]] = {
        ("channels",): settings.channels,
        ("derived",): settings.derived,
    }
    tables |= {("runs", run, "channels"): each.channels for run, each in settings.runs.items()}
    for place, channels in tables.items():
        for name, each in channels.items():
            if each.unit is None:
                continue
            try:
                conversion(each.unit, units_of(name, each.unit), name)
            except RequestError as error:
                yield (*place, name, "unit"), str(error)


def _derived_mistakes(settings: CampaignSettings) -> Iterable[Mistake]:
    names = settings.channel_names
    sound = True
    for name, each in settings.derived.items():
        place = ("derived", name)
        if name in settings.channels:
            yield place, f"[channels.{name}] exists too. Rename one of them."
        try:
            sources = sources_of(name, each, names)
        except RequestError as error:
            sound = False
            yield (*place, "expression"), str(error)
            continue
        key = "expression" if each.expression is not None else "from"
        for source in sources:
            if source not in names:
                near = did_you_mean(source, names)
                yield (
                    (*place, key),
                    f"the channel '{source}' does not exist.{near} Channels: {', '.join(names)}.",
                )
        if each.expression is not None and each.unit is None and canonical_channel(name) is None:
            yield (
                (*place, "unit"),
                f"missing. '{name}' is a free name; state the unit of the expression, such as "
                "unit = 'm' ('-' for none).",
            )
    if sound:
        try:
            needed_channels(settings)
        except RequestError as error:
            yield ("derived",), str(error)
