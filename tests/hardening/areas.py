"""The cases of the attack, by area; those of settings are made from the classes of the settings."""

from __future__ import annotations

import copy
import functools
import gzip
import hashlib
import itertools
import json
import os
import socket
import tempfile
import typing
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import ground
import numpy as np
import tomlkit
import xarray as xr
from attack import Case, command
from pydantic import BaseModel

NUMBERS = (0, -1, 10**8, 10**20, 2**64, 0.5, 1e-320, 1e-9, 1e7, 1e300, float("inf"),
           float("nan"))  # fmt: skip
TEXTS = ("", "x", "/", "../x", "\0", "a\nb", "$\\frac{", "n" * 300, "~seakeep-nobody/x", "heave")
LENGTHS = ("1e300 T", "infT", "1e-9 T", "0 T", "-1 T", "nan T", "1 /T")
OTHERS = (True, [], {}, [[1]], [["1 T"]], [1e-300, 1e300], [5.0, 1.0], {"uniform": [1e-300, 1e300]},
          {"fixed": 1e9}, {"x": {"x": 1}})  # fmt: skip
EXPRESSIONS = {
    "minus": "-" * 5000 + "heave",
    "brackets": "(" * 5000 + "heave" + ")" * 5000,
    "power": "heave + 9**9**9",
    "tower": "9**9**9**9",
    "digits": "heave*" + "9" * 5000,
    "zero": "heave/0",
    "sum": "+".join(["heave"] * 5000),
    "class": "heave.__class__",
    "call": "open('x')",
    "index": "heave[0]",
    "huge": "1e308*1e308*heave",
    "word": "'x'*10**9",
    "list": "[0]*10**9",
    "lambda": "(lambda: 0)()",
    "empty": "average()",
    "root": "sqrt(-1)+heave",
    "shift": "1<<10**9",
}


def areas_of_settings(place: Path) -> Iterator[Case]:
    """Each key of the campaign, the study and the tank, with each absurd value."""
    from seakeep.campaign.settings import CampaignSettings
    from seakeep.study.settings import StudySettings
    from seakeep.tank.settings import TankSettings, default_settings

    tank = ground.read("tank")
    full = default_settings().model_dump(mode="json")
    full["runs"] = tank["runs"]
    for what, root, table in (
        ("campaign", CampaignSettings, ground.read("campaign")),
        ("study", StudySettings, ground.read("study")),
        ("tank", TankSettings, full),
    ):
        for trail, annotation in keys_of(root, table):
            for i, value in enumerate(values_for(annotation)):
                name = f"{what} {'.'.join(trail)} = {str(value)[:20]!r} ({i})"
                yield Case("settings", name, functools.partial(with_key, what, trail, value))
    yield from _tables_of_models()


def _tables_of_models() -> Iterator[Case]:
    """Each key of an observable, of a read-out and of a prior, with each absurd value."""
    from seakeep.models import OBSERVABLES, ReadOut

    priors = {"uniform": [1, 2], "log_uniform": [1, 2], "fixed": 1, "distribution": "norm"}
    kinds: list[tuple[str, Any, Callable[[dict[str, Any]], object]]] = [
        *((kind, made, lambda table: [table]) for kind, made in OBSERVABLES.items()),
        ("readouts", ReadOut, lambda table: {"pitch": table}),
    ]
    for kind, made, within in kinds:
        key = "readouts" if kind == "readouts" else "observables"
        whole = {"of": ["heave"]} if kind == "readouts" else {"kind": kind, "of": ["eta_fwd"]}
        for name in (*(each.name for each in fields(made)), "kind", "x"):
            for i, value in enumerate((*NUMBERS, *TEXTS, *LENGTHS, *OTHERS)):
                table = within({**whole, name: value})
                yield Case("settings", f"{kind} {name} = {str(value)[:20]!r} ({i})",
                           functools.partial(with_key, "campaign", ("model", key),
                                             table))  # fmt: skip
    for key in priors:
        for i, value in enumerate((*NUMBERS, *TEXTS, *OTHERS)):
            yield Case("settings", f"prior {key} = {str(value)[:20]!r} ({i})",
                       functools.partial(with_key, "campaign", ("models", "ensemble", "ridge"),
                                         {key: value}))  # fmt: skip


def with_key(what: str, trail: tuple[str, ...], value: object) -> object:
    """Run what reads a settings file in which one key has another value."""
    table = copy.deepcopy(ground.read(what))
    inner = table
    for key in trail[:-1]:
        inner = inner.setdefault(key, {})
    inner[trail[-1]] = value
    return run_file(what, tomlkit.dumps(table), trail)


def run_file(what: str, text: str, trail: tuple[str, ...] = ()) -> object:
    """Run the command that reads a settings file of this text."""
    Path(f"{what}.toml").write_text(text, encoding="utf-8")
    if what == "study":
        from seakeep.study import read_study, run_study

        run_study(read_study("study.toml"), "o")
        return "done"
    if what == "tank":
        return command("tank", "--settings", "tank.toml", "--out", "o")()
    if trail[:1] == ("models",):
        return command("fit", "campaign.toml", "--model", trail[1], "-o", "o.nc")()
    if trail[:1] == ("model",):
        return command("fit", "campaign.toml", "-o", "o.nc")()
    return command("prepare", "campaign.toml", "-o", "o")()


def values_for(annotation: Any) -> Iterator[object]:
    """Absurd values that the type of a key lets in, and some that it does not."""
    words = str(annotation)
    number, text = "float" in words or "int" in words, "str" in words or "Literal" in words
    yield from NUMBERS if number else NUMBERS[1:4]
    yield from TEXTS if text else TEXTS[1:3]
    yield from LENGTHS if "Length" in words else ()
    yield from OTHERS


Key = tuple[tuple[str, ...], Any]


def keys_of(root: type[BaseModel], table: dict[str, Any]) -> Iterator[Key]:
    """Places of all keys that the tables of a file may have, and their types."""
    for name, field in root.model_fields.items():
        key = field.alias or name
        yield (key,), field.annotation
        inner = table_in(field.annotation)
        there = table.get(key)
        named = dict_of(field.annotation)
        if inner is not None and (isinstance(there, dict) or (there is None and not named)):
            there = there or {}
            if not named:
                yield from (((key, *rest), kind) for rest, kind in keys_of(inner, there))
                continue
            for each in list(there)[: None if key == "models" else 1]:
                yield (key, each), dict
                if isinstance(there[each], dict):
                    yield from (
                        ((key, each, *rest), kind) for rest, kind in keys_of(inner, there[each])
                    )
    if (others := getattr(root, "others", None)) is not None:
        extra = next((k for k in table if k not in root.model_fields), None)
        if extra:
            yield from (((extra, *rest), kind) for rest, kind in keys_of(others, table[extra]))


def dict_of(annotation: Any) -> bool:
    """Whether keys of a table are names of the user's."""
    return typing.get_origin(annotation) is dict or any(
        dict_of(each) for each in typing.get_args(annotation)
    )


def table_in(annotation: Any) -> type[BaseModel] | None:
    """The table that an annotation holds."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = (table_in(each) for each in typing.get_args(annotation))
    return next((each for each in found if each is not None), None)


def texts(place: Path) -> Iterator[Case]:
    """Whole files of settings that no table describes, expressions, chains and headers."""
    campaign = ground.CAMPAIGN
    odd = {
        "empty": "",
        "lists": "a = " + "[" * 5000 + "]" * 5000,
        "tables": "a = " + "{a=" * 2000 + "1" + "}" * 2000,
        "header": "[" + ".".join("a" * 3000) + "]\nb = 1",
        "digits": "[study]\nseed = " + "9" * 5000,
        "digits of a depth": campaign.replace("water_depth = 3.0", "water_depth = " + "9" * 5000),
        "bytes": "\udcff\udcfe",
        "twice": campaign + campaign,
        "no end": "name = '",
        "long": "# " + "x" * 10**7,
    }
    for what in ("campaign", "study", "tank"):
        for name, text in odd.items():
            yield Case("texts", f"{what} {name}", functools.partial(written, what, text))
    for name, text in EXPRESSIONS.items():
        changed = campaign.replace("heave + 2*eta_mid", text)
        yield Case("texts", f"expression {name}", functools.partial(run_file, "campaign", changed))
        changed = campaign.replace("eta_fwd**2", text.replace("heave", "eta_fwd"))
        yield Case("texts", f"observable {name}",
                   functools.partial(run_file, "campaign", changed, ("model",)))  # fmt: skip
    for count in (100, 2000):
        chain = "".join(
            f'[derived.c{i}]\nexpression = "c{i - 1}*1.0"\nunit = "m"\n' for i in range(1, count)
        )
        chain = '[derived.c0]\nexpression = "heave*1.0"\nunit = "m"\n' + chain
        yield Case("texts", f"chain of {count}",
                   functools.partial(run_file, "campaign", campaign + chain))  # fmt: skip
    for encoding in ("utf-7", "rot13", "hex", "zip", "no-such", "\0", "utf_8_sig", "undefined",
                     "unicode_escape", "mbcs", "punycode", "utf-32"):  # fmt: skip
        yield Case("texts", f"encoding {encoding}", functools.partial(
            with_key, "campaign", ("files", "encoding"), encoding))  # fmt: skip
    tables = {
        "header of 200000": "t,p1,p2,trigger," + "x" * 200_000,
        "columns": ",".join(f"c{i}" for i in range(20_000)),
        "quotes": 't,"p1,p2,trigger',
        "zeros": "\0" * 100,
        "controls": "t,p\x01,\x02",
        "time twice": "time,time,time,time",
    }
    rows = "\n" + "\n".join(f"{0.1 * i:.1f},{i % 7},{i % 5},{i % 3}" for i in range(300)) + "\n"
    for cell in (
        "1e300",
        "1e-320",
        "1e400",
        "9" * 400,
        "-",
        "nan",
        "inf",
        "1e",
        "\x00",
        "é",
        "0x10",
    ):
        tables[f"cell {cell[:8]!r}"] = "t [s],p1,p2,trigger" + rows.replace(",3,", f",{cell},")
    for scale in ("1e300", "1e-300", "1e-320"):
        column = "\n".join(f"{0.1 * i:.1f},{i % 7}{scale[1:]},{i % 5},{i % 3}" for i in range(300))
        tables[f"column {scale}"] = "t [s],p1,p2,trigger\n" + column + "\n"
        column = "\n".join(f"{i}{scale[1:]},{i % 7},{i % 5},{i % 3}" for i in range(300))
        tables[f"times {scale}"] = "t [s],p1,p2,trigger\n" + column + "\n"
    for name, text in tables.items():
        full = text if "\n" in text else text + rows
        yield Case("texts", f"table {name}, init", functools.partial(table, full, "init"))
        yield Case("texts", f"table {name}, prepare", functools.partial(table, full, "prepare"))
        yield Case("texts", f"table {name}, fit", functools.partial(table, full, "fit"))


def written(what: str, text: str) -> object:
    """Run a settings file of any bytes."""
    Path(f"{what}.toml").write_bytes(text.encode("utf-8", "surrogateescape"))
    verb = {"campaign": ("prepare", "campaign.toml", "-o", "o"),
            "study": ("study", "study.toml", "-o", "o", "--workers", 1),
            "tank": ("tank", "--settings", "tank.toml", "--out", "o")}  # fmt: skip
    return command(*verb[what])()


def table(text: str, verb: str) -> object:
    """Read a raw file of this text."""
    Path("one_probes.csv").write_text(text, encoding="utf-8")
    if verb == "init":
        return command("init", "one_probes.csv", "-o", "new.toml")()
    if verb == "prepare":
        return command("prepare", "campaign.toml", "-o", "o")()
    return command("fit", "campaign.toml", "--model", "arx", "-o", "o.nc")()


ODD_NAMES = ("a/b", "..", ".", "", " ", "a\0b", "a\nb", "\x1b[31m", "$\\frac{", "$x_{", "\\alpha",
             "n" * 300, "é" * 120, "CON", "time", "channel", "run", "member", "heave_flags",
             "dt", "units", "__class__", "<b>", "=1+1", "a,b", "%s", "{0}", "[red]x", "−",
             "a" * 99 + "b")  # fmt: skip


def names(place: Path) -> Iterator[Case]:
    """Names of channels, runs, models and tests, in every table that has them."""
    tables = {
        "channel": ("campaign", "heave", "pitch", "surge"),
        "run": ("campaign", "one"),
        "model": ("campaign", "ensemble"),
        "derived": ("campaign", "twice"),
        "study model": ("study", "several"),
        "study test": ("study", "same"),
        "tank run": ("tank", "one"),
    }
    for kind, (what, old, *_) in tables.items():
        for i, name in enumerate(ODD_NAMES):
            yield Case("names", f"{kind} {name[:20]!r} ({i})",
                       functools.partial(renamed, what, old, name))  # fmt: skip
    for i, name in enumerate(ODD_NAMES):
        for key in (("campaign", "name"), ("campaign", "description")):
            yield Case("names", f"{key[1]} {name[:20]!r} ({i})",
                       functools.partial(with_key, "campaign", key, name))  # fmt: skip
        for key in (("channels", "heave", "long_name"), ("runs", "one", "sea_state")):
            yield Case("names", f"{key[-1]} {name[:20]!r} ({i})",
                       functools.partial(drawn, key, name))  # fmt: skip
        yield Case("names", f"words of the study {name[:20]!r} ({i})",
                   functools.partial(words_of_study, name))  # fmt: skip


def drawn(key: tuple[str, ...], name: str) -> object:
    """Fit, compare and draw with such a label."""
    table = ground.read("campaign")
    inner = table
    for each in key[:-1]:
        inner = inner[each]
    inner[key[-1]] = name
    Path("campaign.toml").write_text(tomlkit.dumps(table), encoding="utf-8")
    fitted = command("fit", "campaign.toml", "--model", "arx", "-o", "arx.nc")()
    return fitted if fitted == "refused" else command("compare", "arx.nc", "campaign.toml")()


def words_of_study(name: str) -> object:
    """A whole study, its report included, with such words in it."""
    table = ground.read("study")
    table["study"]["name"] = table["study"]["description"] = name
    table["tests"]["same"]["label"] = name
    Path("study.toml").write_text(tomlkit.dumps(table), encoding="utf-8")
    return command("study", "study.toml", "-o", "o", "--workers", 1)()


def renamed(what: str, old: str, new: str) -> object:
    """Give a channel, a run, a model or a test another name, everywhere in a file."""

    def changed(value: Any) -> Any:
        if isinstance(value, dict):
            return {new if k == old else k: changed(v) for k, v in value.items()}
        if isinstance(value, list):
            return [changed(each) for each in value]
        return new if value == old else value

    table = changed(ground.read(what))
    if what == "campaign" and new in table["channels"]:
        table["channels"][new]["column"] = "heave"
        table["derived"]["sum"]["expression"] = "2*eta_mid"
    text = tomlkit.dumps(table)
    if what == "study":
        Path("study.toml").write_text(text, encoding="utf-8")
        return command("study", "study.toml", "-o", "o", "--workers", 1)()
    if what == "tank":
        return run_file("tank", text)
    answer = run_file("campaign", text)
    if answer == "refused":
        return answer
    model = ("models", new) if old == "ensemble" else ("models", "arx")
    answer = run_file("campaign", text, model)
    run = new if old == "one" else "one"
    return answer if answer == "refused" else command(
        "compare", "o.nc", "campaign.toml", "--run", run)()  # fmt: skip


def odd_paths(folder: Path) -> dict[str, str]:
    """Paths of every kind but regular files."""
    os.mkfifo(folder / "fifo.nc")
    os.mkfifo(folder / "fifo.toml")
    os.mkfifo(folder / "fifo.csv")
    (folder / "loop.nc").symlink_to("loop.nc")
    (folder / "zero.csv").symlink_to("/dev/zero")
    (folder / "zero.nc").symlink_to("/dev/zero")
    (folder / "zero.toml").symlink_to("/dev/zero")
    (folder / "folder.nc").mkdir()
    server = socket.socket(socket.AF_UNIX)
    here = Path.cwd()
    os.chdir(folder)
    server.bind("s.nc")
    server.close()
    os.chdir(here)
    (folder / "empty.nc").touch()
    return {
        "device": "/dev/zero", "null": "/dev/null", "random": "/dev/urandom", "full": "/dev/full",
        "fifo": "fifo.nc", "fifo toml": "fifo.toml", "fifo csv": "fifo.csv", "socket": "s.nc",
        "loop": "loop.nc", "folder": "folder.nc", "nul": "a\0b.nc", "long": "n" * 400 + ".nc",
        "long toml": "n" * 400 + ".toml",
        "long path": "n/" * 3000 + "x.nc", "home": "~seakeep-nobody/x.nc", "empty": "empty.nc",
        "nothing": "",
        "zero toml": "zero.toml", "zero csv": "zero.csv", "zero nc": "zero.nc",
        "below a file": "campaign.toml/x.nc", "surrogate": "\udcff.nc",
        "memory": "/proc/self/mem", "messages": "/proc/kmsg", "dash": "-", "dot": ".",
        "newline": "a\nb.nc",
    }  # fmt: skip


COMMANDS: dict[str, tuple[str, ...]] = {
    "init": ("init", "one_mru.csv", "-o", "new.toml"),
    "prepare": ("prepare", "campaign.toml", "-o", "o"),
    "fit": ("fit", "campaign.toml", "-o", "o.nc"),
    "calibrate": ("calibrate", "ensemble.nc", "campaign.toml", "--steps", "2 T", "-o", "o.nc"),
    "forecast": ("forecast", "model.nc", "campaign.toml", "--run", "one", "--start", "45",
                 "--steps", "20", "-o", "o.nc"),
    "compare": ("compare", "model.nc", "campaign.toml", "-o", "o"),
    "study": ("study", "study.toml", "-o", "o", "--workers", "1"),
    "tank": ("tank", "--settings", "tank.toml", "--out", "o"),
    "tune": ("tune", "campaign.toml", "--vary", "ridge", "-o", "o.toml"),
    "track": ("track", "video.avi", "--metres-per-pixel", "0.005", "--panel", "0.3", "0.1", "-o",
              "o.csv"),
    "report": ("report", "results"),
    "reproduce": ("reproduce", "--quick", "-o", "o"),
    "check": ("check", "model.nc", "campaign.toml", "-o", "o"),
    "export": ("export", "arx.nc", "--c", "o", "--mat", "o.mat", "--onnx", "o.onnx"),
}  # fmt: skip


def paths(place: Path) -> Iterator[Case]:
    """Each argument of each command that is a path, and each path in a settings file."""
    with tempfile.TemporaryDirectory() as folder:
        kinds = list(odd_paths(Path(folder)))
    for verb, arguments in COMMANDS.items():
        for i, word in enumerate(arguments):
            is_path = ("." in word and not word[0].isdigit()) or word in ("o", "results")
            if i == 0 or not is_path or "=" in word or (verb == "reproduce" and word != "o"):
                continue
            for kind in kinds:
                yield Case("paths", f"{verb} {word}: {kind}",
                           functools.partial(path_in_command, verb, i, kind))  # fmt: skip
    keys = {
        "campaign": (("runs", "one", "files", "mru"), ("runs", "one", "file")),
        "study": (("study", "campaign"), ("study", "truth")),
        "tank": (("vessel", "hydrodynamics"), ("runs", "one", "spectrum", "file")),
    }
    for what, trails in keys.items():
        for trail in trails:
            for kind in kinds:
                yield Case("paths", f"{what} {'.'.join(trail)}: {kind}",
                           functools.partial(path_in_settings, what, trail, kind))  # fmt: skip
    for function in ("load_model", "load_live", "read_campaign", "read_study", "read_result",
                     "read_columns", "read_tank", "save", "read_reproduction", "track_video",
                     "load_hydrodynamics"):  # fmt: skip
        for kind in kinds:
            yield Case("paths", f"{function}({kind})",
                       functools.partial(path_in_function, function, kind))  # fmt: skip


def path_in_command(verb: str, place: int, kind: str) -> object:
    """Run a command with an odd path in a place."""
    arguments = list(COMMANDS[verb])
    arguments[place] = odd_paths(Path())[kind]
    return command(*arguments)()


def path_in_settings(what: str, trail: tuple[str, ...], kind: str) -> object:
    """Run a settings file with an odd path in a key."""
    path = odd_paths(Path())[kind]
    if "\udcff" in path:
        return "refused"
    return with_key(what, trail, path)


def path_in_function(name: str, kind: str) -> object:
    """Call a function of the Python API with an odd path."""
    import seakeep
    from seakeep.campaign import read_campaign
    from seakeep.formats import read_columns
    from seakeep.signals import TrackingSettings, track_video
    from seakeep.study import read_result, read_study
    from seakeep.study.reproduce import read_reproduction
    from seakeep.tank.hydrodynamics import load_hydrodynamics
    from seakeep.tank.settings import read_tank

    path = odd_paths(Path())[kind]
    calls: dict[str, Callable[[str], object]] = {
        "load_live": lambda p: seakeep.load_live(seakeep.load_model("arx.nc"), p),
        "load_model": seakeep.load_model, "read_campaign": read_campaign, "read_study": read_study,
        "read_result": read_result, "read_columns": read_columns, "read_tank": read_tank,
        "read_reproduction": read_reproduction, "load_hydrodynamics": load_hydrodynamics,
        "save": lambda p: seakeep.load_model("arx.nc").save(p),
        "track_video": lambda p: track_video(p, TrackingSettings(0.01, (0.3, 0.1))),
    }  # fmt: skip
    calls[name](path)
    return "done"


ODD = (None, "x", -1, 10**9, 1e308, float("nan"), [], {}, True, [[1]], 10**400, "9" * 5000)


def leaves(value: Any, place: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Places of all values in a JSON document, tables and lists among them."""
    if place:
        yield place
    items = value.items() if isinstance(value, dict) else enumerate(value[:1]) if isinstance(
        value, list) else ()  # fmt: skip
    for key, each in items:
        yield from leaves(each, (*place, key))


MODELS = ("model", "ensemble", "calibrated", "arx", "subspace", "hold")
CHANGES = ("drop", "empty", "cut", "nan", "huge", "text", "whole", "axis", "zero", "tiny")


def contents(place: Path) -> Iterator[Case]:
    """Model, prepared and study files with a sound checksum and other contents."""
    for name in (each for each in MODELS if (place / f"{each}.nc").exists()):
        with xr.open_dataset(place / f"{name}.nc", engine="h5netcdf") as kept:
            attrs, variables = dict(kept.attrs), list(kept.variables)
        yield from mutations(
            "contents", name, attrs, variables, functools.partial(spoil_model, name)
        )
    places = ("filled", "final", "rows", "begins", "taken", "since", "partly", "complete")
    attrs = {"places": json.dumps(dict.fromkeys(places, 0)), "rig": "{}", "model": "x"}
    arrays = ["u", "x", "y", "delayed", "direct", "gains", "whitenings", "plain", "covariance",
              "history", "innovation", "running", "noise"]  # fmt: skip
    yield from mutations("contents", "live", attrs, arrays, spoil_live)
    if (place / "results").exists():
        yield from study_contents(place, spoil_study)
    with xr.open_dataset(
        place / "prepared" / "one.nc", engine="h5netcdf", decode_times=False
    ) as kept:
        attrs, variables = dict(kept.attrs), list(kept.variables)
    yield from mutations("contents", "prepared", attrs, variables, spoil_prepared)


def study_contents(place: Path, spoil: Callable[..., object]) -> Iterator[Case]:
    """Each attribute of a study, each value in its JSON, and each variable as another one."""
    from seakeep.study import read_result

    result = read_result(place / "results")
    yield from mutations("contents", "study", result.attrs, [], spoil)
    for group in result.groups:
        for each in [None, *result.groups[group].variables]:
            for change in CHANGES:
                yield Case("contents", f"study {group} {each} {change}",
                           functools.partial(spoil, variable=(group, each),
                                             change=change))  # fmt: skip


def mutations(area: str, name: str, attrs: dict[str, Any], variables: list[Any],
              spoil: Callable[..., object]) -> Iterator[Case]:  # fmt: skip
    """Each attribute, each value in its JSON, and each variable as another one."""
    for key, value in attrs.items():
        for i, odd in enumerate((*ODD, "drop")):
            yield Case(area, f"{name} {key} = {odd!r} ({i})", functools.partial(
                spoil, attribute=(key,), value=odd))  # fmt: skip
        try:
            inner = json.loads(value)
        except (TypeError, ValueError):
            continue
        for trail in leaves(inner):
            for i, odd in enumerate((*ODD, "drop")):
                yield Case(area, f"{name} {key} {'.'.join(map(str, trail))} = {odd!r} ({i})",
                           functools.partial(spoil, attribute=(key, *trail),
                                             value=odd))  # fmt: skip
    for variable in variables:
        for change in CHANGES:
            yield Case(area, f"{name} variable {variable} {change}",
                       functools.partial(spoil, variable=variable, change=change))  # fmt: skip


def spoiled(dataset: xr.Dataset, attribute: Any = None, value: Any = None, variable: Any = None,
            change: str = "") -> xr.Dataset:  # fmt: skip
    """A Dataset of which one attribute or one variable is another."""
    if attribute is not None:
        attrs = changed_attrs(dataset.attrs, attribute, value)
        return xr.Dataset(dataset.variables, attrs=attrs)
    kept = {k: v for k, v in dataset.variables.items() if k != variable}
    old = dataset.variables[variable]
    x, dims = np.asarray(old.values), old.dims
    number = x.dtype.kind in "fiub"
    new: Any = {
        "empty": lambda: x[:0] if x.ndim else np.zeros(0),
        "cut": lambda: x[: max(len(x) // 2, 1)] if x.ndim else x,
        "nan": lambda: np.full(x.shape, np.nan),
        "huge": lambda: np.full(x.shape, 1e300),
        "text": lambda: np.full(x.shape, "x"),
        "whole": lambda: np.full(x.shape, 10**12) if not number else x.astype("i8"),
        "axis": lambda: x[..., None],
        "zero": lambda: np.zeros(x.shape),
        "tiny": lambda: np.full(x.shape, 1e-320),
    }.get(change, lambda: None)()
    if new is None:
        return xr.Dataset(kept, attrs=dataset.attrs)
    if new.shape != x.shape:
        dims = tuple(f"other{i}" for i in range(new.ndim))
    try:
        return xr.Dataset({**kept, variable: (dims, new, old.attrs)}, attrs=dataset.attrs)
    except ValueError:
        renamed = {k: v for k, v in kept.items() if variable not in v.dims}
        return xr.Dataset({**renamed, variable: (dims, new, old.attrs)}, attrs=dataset.attrs)


def changed_attrs(attrs: Any, attribute: tuple[Any, ...], value: Any) -> dict[str, Any]:
    """Attributes of which one, or a value in the JSON of one, is another or is missing."""
    attrs = dict(attrs)
    key, *trail = attribute
    if not trail:
        if value == "drop":
            del attrs[key]
        else:
            plain = isinstance(value, str | float) or (type(value) is int and value < 2**63)
            attrs[key] = value if plain else json.dumps(value)
        return attrs
    whole = inner = json.loads(attrs[key])
    for each in trail[:-1]:
        inner = inner[each]
    if value == "drop":
        del inner[trail[-1]]
    else:
        inner[trail[-1]] = value
    attrs[key] = json.dumps(whole)
    return attrs


def spoil_model(name: str, **how: Any) -> object:
    """Use a model of which one thing is another."""
    import seakeep
    from seakeep.campaign import load_prepared, read_campaign
    from seakeep.models import store

    with xr.open_dataset(f"{name}.nc", engine="h5netcdf") as opened:
        kept = opened.load()
    made = spoiled(kept, **how)
    kind = made.attrs.pop("seakeep_kind", "x")
    store.write(made, "spoiled.nc", kind)
    model = seakeep.load_model("spoiled.nc")
    model.summary()
    run = load_prepared(read_campaign("campaign.toml"), names=["one"])["one"]
    model.forecast(run, 45.0, 20)
    if hasattr(model, "forecast_summary"):
        model.forecast_summary(
            run, 45.0, 20, band="calibrated" if name == "calibrated" else "members"
        )
    return "done"


def spoil_live(**how: Any) -> object:
    """Go on from the state of a live model of which one thing is another."""
    import seakeep
    from seakeep.models import store

    model = seakeep.load_model("arx.nc")
    live = model.live()
    for number in range(30):
        live.step(np.sin([number] * len(model.inputs)), np.cos([number] * len(model.states)))
    kept = store.read(live.save("live.nc"))
    made = spoiled(kept, **how)
    store.write(made, "spoiled.nc", made.attrs.pop("seakeep_kind", "x"), "live state")
    again = seakeep.load_live(model, "spoiled.nc")
    for _ in range(3):
        again.step(np.zeros(len(model.inputs)), np.zeros(len(model.states)))
    again.forecast(5)
    return "done"


def spoil_prepared(**how: Any) -> object:
    """Use a prepared run of which one thing is another."""
    from seakeep.files import write_netcdf

    path = Path("prepared/one.nc")
    with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as opened:
        kept = opened.load()
    write_netcdf(path, spoiled(kept, **how))
    from seakeep.campaign import load_prepared, read_campaign

    load_prepared(read_campaign("campaign.toml"), names=["one"])
    return command("fit", "campaign.toml", "--model", "arx", "-o", "o.nc")()


def spoiled_study(
    attrs: Any, groups: Any, attribute: Any = None, value: Any = None, variable: Any = None,
    change: str = "",
) -> tuple[dict[str, Any], dict[str, xr.Dataset]]:  # fmt: skip
    """Attributes and groups of a study of which one thing is another."""
    attrs, groups = dict(attrs), dict(groups)
    if attribute is not None:
        return changed_attrs(attrs, attribute, value), groups
    group, name = variable
    if name is not None:
        groups[group] = spoiled(groups[group], variable=name, change=change)
    elif change == "drop":
        del groups[group]
    elif change == "empty":
        groups[group] = xr.Dataset()
    return attrs, groups


def spoil_study(**how: Any) -> object:
    """Report a study of which one thing is another."""
    from seakeep.study import read_result
    from seakeep.study.store import write_result

    result = read_result("results")
    write_result(Path("results"), *spoiled_study(result.attrs, result.groups, **how))
    return command("report", "results")()


def flips(place: Path) -> Iterator[Case]:
    """Files of which a byte is another, or whose end is missing."""
    rng = np.random.default_rng(7)
    for name, count in (("model.nc", 400), ("ensemble.nc", 200), ("prepared/one.nc", 200),
                        ("results/study.nc", 300), ("foreign.nc", 300), ("foreign.mat", 300),
                        ("foreign.h5", 900), ("one_mru.csv", 60), ("video.avi", 60)):  # fmt: skip
        if not name.startswith("foreign") and not (place / name).exists():
            continue
        for _ in range(count):
            # Bytes of structure lie near the start; those of arrays make little trouble.
            at = int(rng.integers(0, 4096)) if rng.random() < 0.8 else int(rng.integers(0, 10**6))
            yield Case("flips", f"{name} {at}",
                       functools.partial(flip, name, at, int(rng.integers(1, 256))))  # fmt: skip
        for part in (0.1, 0.5, 0.9, 0.999):
            yield Case("flips", f"{name} cut {part}", functools.partial(flip, name, part, 0))


def flip(name: str, at: float, change: int) -> object:
    """Use a file of which a byte was changed."""
    import seakeep
    from seakeep.formats import read_columns

    path = Path(name)
    if name.startswith("foreign"):
        make_foreign(path)
    raw = bytearray(path.read_bytes())
    if change:
        raw[int(at) % len(raw)] ^= change
        path.write_bytes(raw)
    else:
        path.write_bytes(raw[: int(at * len(raw))])
    if name in ("model.nc", "ensemble.nc"):
        seakeep.load_model(path).summary()
        return "done"
    if name.startswith("prepared"):
        return command("fit", "campaign.toml", "--model", "arx", "-o", "o.nc")()
    if name.startswith("results"):
        return command("report", "results")()
    if name == "video.avi":
        return command(*COMMANDS["track"])()
    read_columns(path)
    return command("init", name, "-o", "new.toml", "--force")()


def make_foreign(path: Path) -> None:
    """A measurement as other programs write it."""
    import h5py
    from scipy.io import savemat

    t = np.arange(500) * 0.1
    columns = {"t": t, "heave": np.sin(t), "eta": np.cos(t)}
    if path.suffix == ".mat":
        savemat(path, columns, do_compression=True)
        return
    if path.suffix == ".nc":
        xr.Dataset({k: ("t", v) for k, v in columns.items()}).to_netcdf(path, engine="scipy")
        return
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            file.create_dataset(name, data=values, compression="gzip")
            file[name].attrs["units"] = "m"


def arrays(place: Path) -> Iterator[Case]:
    """Each public function of arrays, with arrays of other shapes and values."""
    from array_calls import CALLS

    for name, (_, *given) in CALLS.items():
        for i in range(len(given)):
            for kind in ARRAYS:
                yield Case("arrays", f"{name} {i}: {kind}", functools.partial(array, name, i, kind))


ARRAYS: dict[str, Callable[[Any], Any]] = {
    "scalar": lambda x: 1.0,
    "empty": lambda x: x[:0],
    "one": lambda x: x[:1],
    "two": lambda x: x[:2],
    "three": lambda x: x[:3],
    "no columns": lambda x: x[:, :0] if x.ndim > 1 else x[:, None][:, :0],
    "another axis": lambda x: x[..., None],
    "axis in front": lambda x: x[None],
    "two in front": lambda x: np.stack([x, x]),
    "columns": lambda x: np.stack([x, x], axis=-1),
    "transposed": lambda x: x.T,
    "shorter": lambda x: x[:-3],
    "flat": lambda x: x.ravel(),
    "nan": lambda x: np.full(x.shape, np.nan),
    "one nan": lambda x: np.where(np.arange(x.size).reshape(x.shape) == 5, np.nan, x),
    "nan window": lambda x: np.where(np.arange(x.size).reshape(x.shape) > x.size // 2, np.nan, x),
    "inf": lambda x: np.full(x.shape, np.inf),
    "constant": np.ones_like,
    "zero": np.zeros_like,
    "huge": lambda x: x * 1e300,
    "large": lambda x: x * 1e140,
    "tiny": lambda x: x * 1e-320,
    "small": lambda x: x * 1e-160,
    "step": lambda x: (np.arange(x.size) > 5).reshape(x.shape) * 1.0,
    "reversed": lambda x: x[::-1],
    "a Dataset": lambda x: xr.Dataset({"heave": ("time", x.ravel())}),
    "a DataArray": lambda x: xr.DataArray(x),
    "text": lambda x: "heave",
    "words": lambda x: ["a", "b"],
    "None": lambda x: None,
    "dict": lambda x: {"a": 1},
    "bool": lambda x: x > 0,
    "int8": lambda x: (10 * x).astype("i1"),
    "half": lambda x: x.astype("f2"),
    "complex": lambda x: x + 1j,
    "float128": lambda x: x.astype("g"),
    "read-only": lambda x: np.broadcast_to(x, x.shape),
    "generator": lambda x: (each for each in [1.0, 2.0]),
    "function": lambda x: print,
}


def array(name: str, place: int, kind: str) -> object:
    """Call a function with one argument that is odd."""
    from array_calls import CALLS

    call, *given = CALLS[name]
    given[place] = ARRAYS[kind](given[place])
    call(*given)
    return "done"


WORDS = ("", "0", "-1", "1", "1e300", "1e-320", "inf", "nan", "infT", "-infT", "1e300 T", "1e-9 T",
         "nanT", "9" * 5000, "9" * 400, "1e400", "58", "57.9", "59.9", "60", "-1e9",
         "18446744073709551616", "1.5", "x", "x" * 300, "\\x00", "é", "ridge=",
         "ridge=1e-320,1e300", "ridge=nan", "state_delays=1000000",
         "n_members=100000000", "1000000000000", "12 T", "tcp://nowhere:1", "0x10",
         "1_000", "½", "٣")  # fmt: skip


def options(place: Path) -> Iterator[Case]:
    """Each option of each command, with each word; flags stand alone and in pairs."""
    for verb, option, values in options_of_commands():
        if not values:
            yield Case("options", f"{verb} {option}", command(*COMMANDS[verb], option))
        for i, word in enumerate(WORDS if values else ()):
            if option == "--scheduler" and word not in ("", "x", "tcp://nowhere:1", "0"):
                continue
            if option == "--workers" and len(word) > 2 and word.isdigit():
                continue
            yield Case("options", f"{verb} {option} {word[:20]} ({i})",
                       command(*COMMANDS[verb], option, *[word] * values))  # fmt: skip
            if verb in ("compare", "check", "export"):
                head, _, *tail = COMMANDS[verb]
                yield Case("options", f"{verb} ensemble {option} {word[:20]} ({i})",
                           command(head, "ensemble.nc", *tail, option,
                                   *[word] * values))  # fmt: skip
    for verb in COMMANDS:
        flags = [o for v, o, values in options_of_commands() if v == verb and not values]
        for first, second in itertools.combinations(flags, 2):
            yield Case("options", f"{verb} {first} {second}",
                       command(*COMMANDS[verb], first, second))  # fmt: skip


def options_of_commands() -> Iterator[tuple[str, str, int]]:
    """Command, option, and how many values it takes, of the commands themselves."""
    import typer

    from seakeep.cli import app

    group: Any = typer.main.get_command(app)
    for verb in COMMANDS:
        for each in group.commands[verb].params:
            if each.param_type_name == "option" and "--help" not in each.opts:
                option = max((*each.opts, *each.secondary_opts), key=len)
                if verb == "reproduce" and option != "--preset":
                    continue  # whatever is taken runs for minutes
                yield verb, option, 0 if each.is_flag else each.nargs


def sizes(place: Path) -> Iterator[Case]:
    """Requests and files that would take more memory or time than there is."""
    for name in SIZES:
        yield Case("sizes", name, functools.partial(size, name))


def _bomb(name: str) -> None:
    block = b"0.1,1,2,3\n" * 10**6
    with gzip.open(name, "wb", compresslevel=1) as file:
        file.write(b"t [s],p1,p2,trigger\n")
        for _ in range(30):
            file.write(block)


def _declared(name: str) -> None:
    import h5py

    with h5py.File(name, "w") as file:
        file.create_dataset("t", (10**9,), "f8", chunks=(10**5,), compression="gzip")
        file.create_dataset("heave", (10**9,), "f8", chunks=(10**5,), compression="gzip")


def _filled(name: str) -> None:
    import h5py

    with h5py.File(name, "w") as file:
        for each in ("t", "heave"):
            made = file.create_dataset(
                each, (4 * 10**8,), "f8", chunks=(10**6,), compression="gzip"
            )
            made[: 10**6] = 1.0


def _sealed(name: str) -> None:
    """Replace a file of ours by one with a sound checksum that declares 10^9 values."""
    import h5py

    from seakeep.files import SEAL, read_sealed

    made = read_sealed(name)
    with h5py.File(made, "r+") as file:
        where = file if "groups" not in file.attrs else file["spectra"]
        where.create_dataset("more", (10**9,), "f8", chunks=(10**5,), fillvalue=1.0)
    content = made.getvalue()
    Path(name).write_bytes(content + SEAL + hashlib.sha256(content).hexdigest().encode())


def _model_request(**how: Any) -> object:
    import seakeep
    from seakeep.campaign import load_prepared, read_campaign

    run = load_prepared(read_campaign("campaign.toml"), names=["one"])["one"]
    model = seakeep.load_model(how.pop("model", "model.nc"))
    return bool(model.forecast(run, 45.0, **how))


def _spec(**how: Any) -> object:
    import seakeep
    from seakeep.campaign import load_prepared, read_campaign

    run = load_prepared(read_campaign("campaign.toml"), names=["one"])["one"]
    seakeep.HankelDMDc(**how).fit(run, states=["heave"], inputs=["eta_fwd"])
    return "done"


def _call(room: str, name: str, **how: Any) -> object:
    import importlib

    t = np.arange(0, 60, 0.05)
    getattr(importlib.import_module(f"seakeep.{room}"), name)(np.sin(t), **how)
    return "done"


def _sealed_then(name: str, verb: str) -> object:
    _sealed(name)
    return command(*COMMANDS[verb])()


def _after(make: Callable[[str], None], name: str, verb: str) -> object:
    make(name)
    if verb == "init":
        return command("init", name, "-o", "new.toml")()
    text = ground.CAMPAIGN.replace("one_mru.csv", name)
    return run_file("campaign", text)


def _rng() -> np.random.Generator:
    return np.random.default_rng(0)


SIZES: dict[str, Callable[[], object]] = {
    "gzip bomb, init": lambda: _after(_bomb, "b.csv.gz", "init"),
    "gzip bomb, prepare": lambda: _after(_bomb, "b.csv.gz", "prepare"),
    "declared set, init": lambda: _after(_declared, "b.h5", "init"),
    "declared set, prepare": lambda: _after(_declared, "b.h5", "prepare"),
    "hollow set, init": lambda: _after(_filled, "b.h5", "init"),
    "declared set in a model": lambda: _sealed_then("model.nc", "compare"),
    "declared set in an ensemble": lambda: _sealed_then("ensemble.nc", "calibrate"),
    "declared set in a study": lambda: _sealed_then("results/study.nc", "report"),
    "declared set in a prepared run": lambda: _sealed_then("prepared/one.nc", "fit"),
    "forecast of 10^12 steps": lambda: _model_request(steps=10**12),
    "forecast of 10^12 steps by an ensemble": lambda: _model_request(
        model="ensemble.nc", steps=10**12),
    "forecast of 2^70 steps": lambda: _model_request(steps=2**70),
    "10^8 delays": lambda: _spec(state_delays=10**8, input_delays=2, ridge=1.0),
    "10^18 delays": lambda: _spec(state_delays=10**18, input_delays=2, ridge=1.0),
    "200 delays": lambda: _spec(state_delays=200, input_delays=2, ridge=1.0),
    "10^8 members": lambda: with_key("campaign", ("models", "ensemble", "n_members"), 10**8),
    "10^15 members": lambda: with_key("campaign", ("models", "ensemble", "n_members"), 10**15),
    "bootstrap of 10^8": lambda: _call("statistics", "moving_block_bootstrap", n_series=10**8,
                                      block_length=9, rng=_rng()),
    "bootstrap of 10^20": lambda: _call("statistics", "moving_block_bootstrap", n_series=10**20,
                                       block_length=9, rng=_rng()),
    "density of 10^8": lambda: _call("statistics", "density_interval", n_series=10**8,
                                    block_length=9, rng=_rng()),
    "filter of 1e-9": lambda: _call("signals", "low_pass", dt=0.05, passband=2.0,
                                    stopband=2.000000001),
    "filter of 1e-6": lambda: _call("signals", "low_pass", dt=0.05, passband=2.0,
                                    stopband=2.000001),
    "band of 1e-12": lambda: _call("signals", "band_pass", dt=0.05, band=(1e-12, 2.0)),
    "integrate from 1e-300": lambda: _call("signals", "integrate", dt=0.05, band=(1e-300, 2.0)),
    "predict 10^12": lambda: _call("signals", "predict_waves", count=10**12),
    "step of 1e-300": lambda: _call("signals", "wave_spectrum", dt=1e-300),
    "step of 1e300": lambda: _call("signals", "wave_statistics", dt=1e300),
    "distance of 1e12": lambda: _call("signals", "delay_by_celerity", dt=0.05,
                                     distance=np.full(1200, 1e12), celerity=3.0),
    "celerity of 1e-300": lambda: _call("signals", "delay_by_celerity", dt=0.05,
                                       distance=np.full(1200, 1.0), celerity=1e-300),
    "rate of 10^7": lambda: with_key("campaign", ("preparation", "sampling_rate"), 1e7),
    "instants of a period": lambda: with_key(
        "campaign", ("preparation",), {"steps_per_period": 10**6}),
    "depth of 1e308": lambda: with_key("campaign", ("rig", "water_depth"), 1e308),
    "depth of 1e-308": lambda: with_key("campaign", ("rig", "water_depth"), 1e-308),
    "probe at 10^6 m": lambda: with_key("campaign", ("rig", "positions", "eta_fwd"), -1e6),
    "lead of 10^6": lambda: with_key("campaign", ("model", "lead"), 10**6),
    "10^8 redrawn series": lambda: with_key("study", ("statistics", "n_series"), 10**8),
    "gap of 1e300": lambda: _call("signals", "bridge", dt=0.05, longest=1e300),
}  # fmt: skip


def size(name: str) -> object:
    """Make a request of such a size."""
    return SIZES[name]()


AREAS: dict[str, Callable[[Path], Iterator[Case]]] = {
    "settings": areas_of_settings,
    "texts": texts,
    "names": names,
    "paths": paths,
    "options": options,
    "contents": contents,
    "flips": flips,
    "arrays": arrays,
    "sizes": sizes,
}
