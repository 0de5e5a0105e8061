"""A Dask cluster as a user starts it: a scheduler and workers, each a process on loopback."""

import contextlib
import os
import re
import subprocess
import sys
import time
from pathlib import Path

HELPERS = Path(__file__).parent
LIMIT = 300
"""Seconds in which a process must be ready: it takes 2 on an idle machine."""


class Cluster:
    """Started when made, ended by :meth:`close`."""

    def __init__(self, folder, workers):
        self.processes = []
        self._folder = folder
        scheduler = self._start("scheduler", "--port", "0", "--dashboard-address", "127.0.0.1:0")
        self.address = self._read(*scheduler, r"Scheduler at:\s+(tcp://\S+)")
        self.add_workers(workers)

    def add_workers(self, count):
        """Start workers and wait until the scheduler knows them."""
        worker = ("worker", self.address, "--nthreads", "1", "--no-nanny")
        for process, log in [self._start(*worker) for _ in range(count)]:
            self._read(process, log, r"Registered to:\s+(tcp://\S+)")

    def _start(self, *arguments):
        log = self._folder / f"{arguments[0]}{len(self.processes)}.log"
        environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(HELPERS), *sys.path])}
        command = [sys.executable, "-m", "dask", *arguments]
        with log.open("w") as file:
            process = subprocess.Popen(
                [*command, "--host", "127.0.0.1", "--no-dashboard"],
                stdout=file,
                stderr=subprocess.STDOUT,
                env=environment,
                cwd=self._folder,
            )
        self.processes.append(process)
        return process, log

    def _read(self, process, log, pattern):
        deadline = time.monotonic() + LIMIT
        while True:
            ended = process.poll() is not None  # asked first: its last words are in the log then
            if found := re.search(pattern, log.read_text("utf-8")):
                return found.group(1)
            if ended or time.monotonic() > deadline:
                self.close()
                raise AssertionError(log.read_text("utf-8"))
            time.sleep(0.05)

    def close(self):
        for process in self.processes:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            process.wait()
