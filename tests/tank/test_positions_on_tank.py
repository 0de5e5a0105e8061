"""Stated probe positions on the virtual tank's raw files, prepared: none is doubted but a wrong
one."""

import pytest

from seakeep.quality import Record, findings_of
from seakeep.quality.sensors import SensorsKind, positions

pytest.importorskip("numba", reason="needs the extra tank")


def test_the_tank_s_positions_are_not_doubted(prepared):
    assert not [each for run in prepared.values() for each in findings_of(run)
                if each.kind is SensorsKind.POSITION]  # fmt: skip


@pytest.mark.parametrize("probe", ["eta_us_hml", "eta_kn_fwd"])
def test_a_probe_stated_wrongly_by_the_paper_s_is_named_in_every_run(prepared, probe):
    for run in prepared.values():
        wrong = run.copy()
        wrong[probe] = run[probe].copy()
        wrong[probe].attrs["x_position"] = run[probe].attrs["x_position"] - 0.18
        depth, waves = run.attrs["water_depth"], run.attrs["waves"]
        found = positions(Record("run", wrong, waves=waves, water_depth=depth))
        assert [each.channel for each in found] == [probe]
