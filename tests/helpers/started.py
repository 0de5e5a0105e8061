"""Commands that run beside a test."""

import subprocess
import threading
from contextlib import contextmanager

LIMIT = 600
"""Seconds after which a command is taken for hung; what the tests wait for takes some seconds."""


@contextmanager
def started(command, folder, **streams):
    """A process in a folder, which does not outlive its test, and is ended if it hangs."""
    with subprocess.Popen(command, cwd=folder, text=True, **streams) as process:
        limit = threading.Timer(LIMIT, process.kill)
        limit.start()
        try:
            yield process
        finally:
            limit.cancel()
            process.kill()
