"""An attack on the commands and the public functions: absurd settings, files, paths and arrays.

Each case runs in a forked process with a limit of time and memory. What is expected of it is an
answer: a result, or an error of ours that says what was received. Anything else falls.

``python tests/hardening/attack.py`` runs all cases (44 000: hours on one core) and prints how many
there are and how many fall, by area; ``--every 30`` runs a sample (half an hour), ``--area`` one
area, ``--show`` prints the cases that fall.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

SECONDS = 20
"""Of the processor. A case on a campaign of a minute takes one or two; a hang takes all."""
PATIENCE = 90
"""Seconds of the clock, for what waits and for a busy machine."""
GROWTH = 2**30
"""Bytes that a case may take beyond what its imports take; a campaign of a minute takes 50 MiB."""
FAULT = "This is a fault of seakeep"


@dataclass(frozen=True)
class Case:
    """A call of which an answer is expected; it runs in a folder of its own."""

    area: str
    name: str
    call: Callable[[], object]


@dataclass(frozen=True)
class Verdict:
    """What came of a case: "done", "refused", or how it fell."""

    kind: str
    words: str = ""

    @property
    def stands(self) -> bool:
        """Whether it was answered."""
        return self.kind in ("done", "refused")


def command(*arguments: object) -> Callable[[], object]:
    """Call of a command."""

    def call() -> str:
        from seakeep.cli import main

        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            status = main([str(each) for each in arguments])
        words = said.getvalue()
        if FAULT in words or "Traceback" in words or status not in (0, 1, 2):
            raise AssertionError(words[-600:] or f"status {status}")
        return "refused" if status else "done"

    return call


def judged(case: Case, ground: Path) -> Verdict:
    """Run a case in a process of its own."""
    folder = Path(tempfile.mkdtemp(prefix="attack-"))
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # threads of others, which stand still
        child = os.fork()
    if child == 0:
        os.close(reading)
        _run(case, ground, folder, writing)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        answer = pipe.read().decode("utf-8", "replace")
    _, status, used = os.wait4(child, 0)
    shutil.rmtree(folder, ignore_errors=True)
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        slow = number in (signal.SIGALRM, signal.SIGXCPU, signal.SIGKILL)
        return Verdict("hang" if slow else f"signal {number}")
    kind, _, words = answer.partition("\n")
    before = int(words.partition("\n")[0] or 0)
    if used.ru_maxrss * 1024 - before > GROWTH or "MemoryError" in words:
        return Verdict("memory", words)
    return Verdict(kind or "no answer", words.partition("\n")[2])


def _run(case: Case, ground: Path, folder: Path, writing: int) -> None:
    """Run a case in the child, and end there."""
    kind, words = "done", ""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    try:
        os.environ["HOME"] = str(folder)
        tempfile.tempdir = None
        os.environ["TMPDIR"] = str(folder)
        null = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(null, stream)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(PATIENCE)
        resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + SECONDS,) * 2)
        room = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (room + 3 * GROWTH, room + 3 * GROWTH))
        shutil.copytree(ground, folder / "g")
        os.chdir(folder / "g")
        from seakeep.errors import SeakeepError

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                kind = "refused" if case.call() == "refused" else "done"
        except SeakeepError as error:
            kind, words = "refused", str(error)
        except BaseException:
            kind, words = "fault", traceback.format_exc()
    finally:
        answer = f"{kind}\n{before}\n{words}"
        os.write(writing, answer.encode("utf-8", "replace")[:60_000])
        os._exit(0)


def sample(cases: Iterable[Case], every: int) -> Iterator[Case]:
    """Every so many-th of the cases, spread by their names and the same each time."""
    for case in cases:
        if every <= 1 or zlib.crc32(f"{case.area} {case.name}".encode()) % every == 0:
            yield case


def main() -> int:
    """Print the table of counts."""
    import ground
    from areas import AREAS

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--area", action="append", choices=list(AREAS))
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--show", action="store_true")
    parser.add_argument("--match", default="")
    asked = parser.parse_args()
    fell = Counter[str]()
    with tempfile.TemporaryDirectory() as folder:
        place = ground.prepare(Path(folder))
        print(f"{'area':<12}{'cases':>7}{'stand':>7}{'faults':>8}{'hangs':>7}{'memory':>8}")
        for area in asked.area or AREAS:
            found = Counter[str]()
            for case in sample(AREAS[area](place), asked.every):
                if asked.match not in case.name:
                    continue
                verdict = judged(case, place)
                kind = "stand" if verdict.stands else verdict.kind
                found[kind if kind in ("stand", "hang", "memory") else "fault"] += 1
                if asked.show and not verdict.stands:
                    last = verdict.words.strip().splitlines()[-1:] or [""]
                    print(f"  {area}: {case.name}: {verdict.kind}: {last[0][:300]}", flush=True)
            fell += found
            _row(area, found)
    _row("all", fell)
    return int(fell.total() > fell["stand"])


def _row(name: str, found: Counter[str]) -> None:
    counts = (found.total(), found["stand"], found["fault"], found["hang"], found["memory"])
    widths = (7, 7, 8, 7, 8)
    shown = (f"{count:>{width}}" for count, width in zip(counts, widths, strict=True))
    print(f"{name:<12}" + "".join(shown), flush=True)


if __name__ == "__main__":
    here = Path(__file__).parent
    sys.path[:0] = [str(here), str(here.parent / "helpers")]
    sys.exit(main())
