"""Play a measured run through the C estimator, with samples lost, and compare it with Python.

    seakeep fit docs/tutorial/campaign.toml -o model.nc
    python examples/in_service/play_c.py model.nc docs/tutorial/campaign.toml unseen

A tenth of the samples has neither waves nor states. The script writes the C sources with
`seakeep.hosts.write_estimator`, compiles them with `cc`, and calls them as any program would.
"""

import ctypes
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import seakeep
from seakeep.campaign import load_prepared

LOST = 0.1
STEPS = 25  # of the forecast after the last sample


def compiled(model, folder):
    """Library of the estimator of a model."""
    seakeep.hosts.write_estimator(model, folder, "rom")
    sources = ["rom.c", "rom_estimator.c"]
    flags = ["-std=c99", "-O2", "-fPIC", "-shared"]
    # The size of the struct is asked of C.
    Path(folder, "size.c").write_text(
        '#include "rom_estimator.h"\n'
        "const unsigned long size = sizeof(rom_estimator);\n"
        "const int state_count = ROM_STATES;\n"
    )
    command = ["cc", *flags, "-o", "rom.so", *sources, "size.c", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(Path(folder, "rom.so")))


def pointer(values):
    """Address of an array of doubles."""
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def play(model, run, folder, seed=0):
    """Estimates of C and of Python, shape (time, state), and forecasts after the last sample."""
    rng, library = np.random.default_rng(seed), compiled(model, folder)
    u = np.stack([run[name].values for name in model.inputs], axis=1)
    y = np.stack([run[name].values for name in model.states], axis=1)
    lost = rng.uniform(size=len(u)) < LOST
    lost[: model.history_samples] = False
    u[lost], y[lost] = np.nan, np.nan
    size = ctypes.c_ulong.in_dll(library, "size").value
    vessel = ctypes.create_string_buffer(size)  # zero at its start
    library.rom_estimated.restype = ctypes.POINTER(ctypes.c_double)
    live, estimates = model.live(), []
    for row, states in zip(u, y, strict=True):
        if library.rom_estimate(vessel, pointer(row), pointer(states)):
            raise SystemExit("a sample was refused")
        of_c = np.array(library.rom_estimated(vessel)[: y.shape[1]])
        estimates.append((of_c, live.step(row, states)))
    ahead = np.empty((STEPS, y.shape[1]))
    library.rom_forecast(vessel, STEPS, None, pointer(ahead), None)
    outside = library.rom_validity(vessel)
    return np.array(estimates), ahead, outside, lost


def main(model, campaign, name):
    """Play a run of a campaign, and print what came of it."""
    fitted = seakeep.load_model(model)
    run = load_prepared(seakeep.read_campaign(campaign), names=[name])[name]
    with tempfile.TemporaryDirectory() as folder:
        estimates, ahead, outside, lost = play(fitted, run, folder)
    of_c, of_python = estimates[:, 0], estimates[:, 1]
    print(f"C and Python differ by {np.abs(of_c - of_python).max():.1g} at most")
    for column, state in enumerate(fitted.states):
        measured = run[state].values
        error = (of_c[:, column] - measured)[lost]
        print(
            f"{state}: error of lost samples {np.sqrt(np.mean(error**2)) / measured.std():.3f} SD; "
            f"in {STEPS * fitted.dt:g} s {ahead[-1, column]:.3g} {run[state].attrs['units']}"
        )
    print("all inside the training" if not outside else f"outside the training: {outside}")


if __name__ == "__main__":
    main(*sys.argv[1:])
