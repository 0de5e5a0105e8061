from dataclasses import replace

import numpy as np
import pytest

from seakeep.campaign import load_prepared, write_prepared
from seakeep.tank.dynamics import assemble_rig
from seakeep.tank.hydrodynamics import load_hydrodynamics
from seakeep.tank.seas import Sea
from seakeep.tank.settings import DriftSettings, default_settings


@pytest.fixture(scope="session")
def settings():
    return default_settings()


@pytest.fixture(scope="session")
def hydro():
    return load_hydrodynamics()


@pytest.fixture(scope="session")
def rig(settings, hydro):
    return assemble_rig(settings, hydro)


@pytest.fixture(scope="session")
def linear_rig(rig):
    """The rig without drag, drift or quadratic pool loss."""
    return replace(
        rig,
        quadratic=np.zeros_like(rig.quadratic),
        pool=rig.pool * [1.0, 0.0, 1.0],
        drift=DriftSettings(scale=0.0),
    )


@pytest.fixture(scope="session")
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


@pytest.fixture(scope="session")
def delivered(tmp_path_factory):
    """The irregular runs as the tank delivers them; the truth was read and then deleted."""
    import chain_on_tank

    return chain_on_tank.deliver(tmp_path_factory.mktemp("delivered"))


@pytest.fixture(scope="session")
def prepared(delivered):
    """Those runs prepared, and written where the commands look for them."""
    assert not (delivered.campaign.path.parent / "truth").exists()
    write_prepared(delivered.campaign)
    return load_prepared(delivered.campaign)


@pytest.fixture(scope="session")
def calm():
    none = np.zeros(0)
    return Sea(none, none, none, none)
