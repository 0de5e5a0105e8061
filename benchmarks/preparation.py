"""Time and memory of `seakeep prepare` on the paper's whole campaign of raw files.

    python benchmarks/preparation.py [--out FILE.md]

The virtual tank plays the six runs of the paper: wave probes and load cells at 500 Hz, motion
reference unit at 50 Hz, video at 30 Hz. Each command runs in a process of its own, whose times
and peak memory that the system reports. The second case is interrupted (as by Ctrl-C) once two runs
are written, and started again.
"""

from __future__ import annotations

import argparse
import os
import platform
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

WRITTEN_BEFORE = 2


def measured(command: list[str], interrupt=None) -> tuple[float, float, float, int]:
    """Wall and processor time (s), peak memory (MiB) and exit status of a command."""
    begin = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    told = 0
    while interrupt is not None and process.stderr is not None:
        line = process.stderr.readline()
        told += bool(line)
        if not line or interrupt():
            process.send_signal(signal.SIGINT)
            break
    assert process.stderr is not None
    told += len(process.stderr.readlines())
    _, status, usage = os.wait4(process.pid, 0)
    assert told > 0, "no progress was shown"
    wall, busy = time.perf_counter() - begin, usage.ru_utime + usage.ru_stime
    return wall, busy, usage.ru_maxrss / 1024, os.waitstatus_to_exitcode(status)


def main() -> None:
    """Print the table, and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    place = Path(__file__).parent / "results" / "preparation.md"
    parser.add_argument("--out", type=Path, default=place, help="file for the table")
    out = parser.parse_args().out
    seakeep = [sys.executable, "-m", "seakeep"]
    with tempfile.TemporaryDirectory() as folder:
        campaign, prepared = Path(folder) / "campaign.toml", Path(folder) / "prepared"
        subprocess.run([*seakeep, "tank", "--out", folder], check=True, capture_output=True)
        size = sum(path.stat().st_size for path in Path(folder).glob("raw/*/*")) / 2**20
        whole = measured([*seakeep, "prepare", str(campaign)])
        files = sorted(path.name for path in prepared.glob("*.nc"))
        shutil.rmtree(prepared)

        def half_way() -> bool:
            return len(list(prepared.glob("*.nc"))) >= WRITTEN_BEFORE

        half = measured([*seakeep, "prepare", str(campaign)], half_way)
        left = sorted(path.name for path in prepared.glob("*.nc"))
        again = measured([*seakeep, "prepare", str(campaign)])
        assert files == sorted(path.name for path in prepared.glob("*.nc"))
    lines = [
        "# Preparing the paper's raw campaign",
        "",
        f"Made by `python benchmarks/preparation.py`: {len(files)} runs, {size:.0f} MiB of CSV at "
        "500, 50 and 30 Hz.",
        f"Python {platform.python_version()}, {platform.machine()}, one process, a machine shared "
        "with other work.",
        "",
        "| command | wall time | processor time | peak memory | exit status |",
        "|---|---|---|---|---|",
    ]
    cases = {
        "`seakeep prepare campaign.toml`": whole,
        f"interrupted with {len(left)} of {len(files)} runs written": half,
        "the same command again": again,
    }
    for name, (wall, busy, memory, status) in cases.items():
        lines.append(f"| {name} | {wall:.1f} s | {busy:.1f} s | {memory:.0f} MiB | {status} |")
    text = "\n".join(lines) + "\n"
    print(text)
    out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
