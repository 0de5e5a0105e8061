import os
import pickle
from dataclasses import replace

import numpy as np
import pytest
from altered import altered
from filelock import FileLock

from seakeep.campaign import load_prepared, write_prepared
from seakeep.tank.dynamics import assemble_rig
from seakeep.tank.hydrodynamics import load_hydrodynamics
from seakeep.tank.play import play_run
from seakeep.tank.settings import DriftSettings, default_settings

of_all_tests = pytest.fixture(scope="session")


@of_all_tests
def settings():
    return default_settings()


@of_all_tests
def hydro():
    return load_hydrodynamics()


@of_all_tests
def rig(settings, hydro):
    return assemble_rig(settings, hydro)


@of_all_tests
def linear_rig(rig):
    """The rig without drag, drift or quadratic pool loss."""
    return replace(
        rig,
        quadratic=np.zeros_like(rig.quadratic),
        pool=rig.pool * [1.0, 0.0, 1.0],
        drift=DriftSettings(scale=0.0),
    )


@of_all_tests
def ideal_rig(linear_rig):
    """The rig with no losses but radiation."""
    lines = linear_rig.lines.copy()
    lines[:, 6] = 0.0
    return replace(
        linear_rig,
        linear=np.zeros_like(linear_rig.linear),
        pool=linear_rig.pool * [1.0, 0.0, 0.0],
        lines=lines,
    )


@of_all_tests
def short(settings):
    """One irregular and one regular run, half a minute each."""
    runs = {
        name: altered(settings.runs[name], startup=10.0, duration=20.0)
        for name in ("irregular_1", "regular_2")
    }
    return altered(settings, runs=runs)


@of_all_tests
def played(short, rig):
    """The irregular one."""
    return play_run(short, "irregular_1", rig)


@of_all_tests
def delivered(tmp_path_factory):
    """The irregular runs as the tank delivers them; the truth was read and then deleted.

    They are prepared and written where the commands look for them, once for all processes of
    pytest-xdist.
    """
    import chain_on_tank

    place = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        place = place.parent
    kept = place / "delivered.pickle"
    with FileLock(place / "delivered.lock"):
        if not kept.exists():
            found = chain_on_tank.deliver(place / "delivered", kind="nc")
            assert not (place / "delivered" / "truth").exists()
            write_prepared(found.campaign)
            kept.write_bytes(pickle.dumps(found))
    return pickle.loads(kept.read_bytes())


@of_all_tests
def prepared(delivered):
    """Those runs, prepared."""
    return load_prepared(delivered.campaign)
