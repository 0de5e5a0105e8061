"""Bad input as it comes through the doors: settings, paths, options and bytes."""

from __future__ import annotations

import copy
import functools
import itertools
import os
import typing
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import ground
import numpy as np
import tomlkit
from attack import command
from pydantic import BaseModel

Case = tuple[str, Callable[[], object]]
VALUES: dict[str, tuple[Any, ...]] = {
    "number": (0, -1, 10**8, 0.5, 1e7, float("inf"), float("nan")),
    "text": ("", "x", "/", "../x", "a\nb", "$\\frac{", "~seakeep-nobody/x", "heave"),
    "length": ("1e6 T", "infT", "0 T", "-1 T", "nan T", "1 /T"),
    "other": (True, [], {}, [[1]], [["1 T"]], [5.0, 1.0], {"fixed": 1e9}, {"x": {"x": 1}}),
}


def settings() -> Iterator[Case]:
    """Each key of the campaign, the study and the tank, with values of every type."""
    from seakeep.campaign.settings import CampaignSettings
    from seakeep.study.settings import StudySettings
    from seakeep.tank.settings import TankSettings, default_settings

    full = default_settings().model_dump(mode="json") | {"runs": ground.read("tank")["runs"]}
    for what, root, table in (
        ("campaign", CampaignSettings, ground.read("campaign")),
        ("study", StudySettings, ground.read("study")),
        ("tank", TankSettings, full),
    ):
        for trail in _keys(root, table):
            for i, value in enumerate(itertools.chain(*VALUES.values())):
                name = f"{what} {'.'.join(trail)} = {str(value)[:20]!r} ({i})"
                yield name, functools.partial(with_key, what, trail, value)


def with_key(what: str, trail: tuple[str, ...], value: object) -> None:
    """Run what reads a settings file in which one key has another value."""
    table = copy.deepcopy(ground.read(what))
    inner = table
    for key in trail[:-1]:
        inner = inner.setdefault(key, {})
    inner[trail[-1]] = value
    run_file(what, tomlkit.dumps(table), trail)


def run_file(what: str, text: str, trail: tuple[str, ...] = ()) -> None:
    """Run the command that reads a settings file of this text."""
    Path(f"{what}.toml").write_text(text, encoding="utf-8")
    if what == "study":
        command("study", "study.toml", "-o", "o", "--workers", 1)
    elif what == "tank":
        command("tank", "--settings", "tank.toml", "--out", "o")
    elif trail[:1] == ("model",) or (len(trail) > 1 and trail[0] == "models"):
        named = ("--model", trail[1]) if trail[0] == "models" else ()
        command("fit", "campaign.toml", *named, "-o", "o.nc")
    else:
        command("prepare", "campaign.toml", "-o", "o")


def _keys(root: type[BaseModel], table: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    """Places of all keys that the tables of a file may have."""
    for name, field in root.model_fields.items():
        key = field.alias or name
        yield (key,)
        inner, there = _table_in(field.annotation), table.get(key)
        if inner is None or not isinstance(there, dict | None):
            continue
        if not _names_in(field.annotation):
            yield from ((key, *rest) for rest in _keys(inner, there or {}))
            continue
        for each in list(there or {})[: None if key == "models" else 1]:
            yield (key, each)
            if isinstance(there[each], dict):
                yield from ((key, each, *rest) for rest in _keys(inner, there[each]))
    extra = next((key for key in table if key not in root.model_fields), None)
    if (others := getattr(root, "others", None)) is not None and extra:
        yield from ((extra, *rest) for rest in _keys(others, table[extra]))


def _names_in(annotation: Any) -> bool:
    """Whether keys of a table are names of the user's."""
    return typing.get_origin(annotation) is dict or any(
        _names_in(each) for each in typing.get_args(annotation)
    )


def _table_in(annotation: Any) -> type[BaseModel] | None:
    """The table that an annotation holds."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = (_table_in(each) for each in typing.get_args(annotation))
    return next((each for each in found if each is not None), None)


COMMANDS: dict[str, tuple[str, ...]] = {
    "init": ("init", "one_mru.csv", "-o", "new.toml"),
    "prepare": ("prepare", "campaign.toml", "-o", "o"),
    "fit": ("fit", "campaign.toml", "-o", "o.nc"),
    "calibrate": ("calibrate", "ensemble.nc", "campaign.toml", "--steps", "2 T", "-o", "o.nc"),
    "forecast": ("forecast", "model.nc", "campaign.toml", "--run", "one", "--start", "45",
                 "--steps", "20", "-o", "o.nc"),
    "compare": ("compare", "ensemble.nc", "campaign.toml", "-o", "o"),
    "study": ("study", "study.toml", "-o", "o", "--workers", "1"),
    "tank": ("tank", "--settings", "tank.toml", "--out", "o"),
    "tune": ("tune", "campaign.toml", "--vary", "ridge", "-o", "o.toml"),
    "report": ("report", "results"),
    "check": ("check", "model.nc", "campaign.toml", "-o", "o"),
    "export": ("export", "arx.nc", "--c", "o", "--mat", "o.mat", "--onnx", "o.onnx"),
}  # fmt: skip
PATHS = ("pipe", "loop", "folder", "empty", "campaign.toml", "campaign.toml/x", "~nobody-here/x",
         "nowhere/x", "")  # fmt: skip
KEYS = {
    "campaign": (("runs", "one", "files", "mru"), ("runs", "one", "file")),
    "study": (("study", "campaign"), ("study", "truth")),
    "tank": (("vessel", "hydrodynamics"), ("runs", "one", "spectrum", "file")),
}


def paths() -> Iterator[Case]:
    """Each argument of each command that is a path, and each path in a settings file."""
    for verb, arguments in COMMANDS.items():
        for place, word in enumerate(arguments):
            if place and (word in ("o", "results") or Path(word).suffix):
                for path in PATHS:
                    changed = [*arguments[:place], path, *arguments[place + 1 :]]
                    yield f"{verb} {word}: {path}", functools.partial(at_paths, command, *changed)
    for what, trails in KEYS.items():
        for trail, path in itertools.product(trails, PATHS):
            call = functools.partial(at_paths, with_key, what, trail, path)
            yield f"{what} {'.'.join(trail)}: {path}", call


def at_paths(call: Callable[..., object], *arguments: object) -> None:
    """Make paths that are no files, and call."""
    os.mkfifo("pipe")
    Path("loop").symlink_to("loop")
    Path("folder").mkdir()
    Path("empty").touch()
    call(*arguments)


WORDS = ("", "0", "-1", "1e300", "inf", "nan", "infT", "1e6 T", "0 T", "57.9", "60", "-1e9", "1.5",
         "x", "ridge=", "ridge=nan", "n_members=0", "tcp://nowhere:1", "1_000")  # fmt: skip


def options() -> Iterator[Case]:
    """Each option of each command, with each word; flags stand alone and in pairs."""
    import typer

    from seakeep.cli import app

    group: Any = typer.main.get_command(app)
    for verb, arguments in COMMANDS.items():
        flags = []
        for each in group.commands[verb].params:
            option = max((*each.opts, *each.secondary_opts), key=len)
            if each.param_type_name != "option" or "--help" in each.opts:
                continue
            if each.is_flag:
                flags.append(option)
            for word in () if each.is_flag else WORDS:
                call = functools.partial(command, *arguments, option, *[word] * each.nargs)
                yield f"{verb} {option} {word}", call
        for both in itertools.combinations_with_replacement(flags, 2):
            yield f"{verb} {' '.join(both)}", functools.partial(command, *arguments, *both)


def flips() -> Iterator[Case]:
    """Files of which a byte is another, or whose end is missing."""
    rng = np.random.default_rng(7)
    for name in ("model.nc", "prepared/one.nc", "results/study.nc", "one_mru.csv"):
        for part in (0.1, 0.5, 0.9, 0.999):
            yield f"{name} cut {part}", functools.partial(damaged, name, part, 0)
        for _ in range(50):
            # Bytes of structure lie near the start; those of arrays make little trouble.
            at = int(rng.integers(0, 4096)) if rng.random() < 0.8 else int(rng.integers(0, 10**6))
            change = int(rng.integers(1, 256))
            yield f"{name} {at}", functools.partial(damaged, name, at, change)


def damaged(name: str, at: float, change: int) -> None:
    """Use a file of which a byte was changed, or the end cut off."""
    path = Path(name)
    raw = bytearray(path.read_bytes())
    if change:
        raw[int(at) % len(raw)] ^= change
    path.write_bytes(raw if change else raw[: int(at * len(raw))])
    verbs = {"model.nc": "check", "prepared/one.nc": "fit", "results/study.nc": "report"}
    command(*COMMANDS[verbs.get(name, "init")])


AREAS: dict[str, Callable[[], Iterator[Case]]] = {
    each.__name__: each for each in (settings, paths, options, flips)
}
