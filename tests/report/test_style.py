"""Pictures are those that matplotlib draws."""

import numpy as np
import pytest
from records import rms

pytest.importorskip("matplotlib")

from PIL import Image

from seakeep.report.style import figure_style, new_figure, save_figure


def drawing():
    with figure_style():
        figure = new_figure(9.5, 3.2)
        axes = figure.subplots()
        axes.plot(np.sin(np.arange(200) / 7), label="measured")
        axes.set_xlabel("time [s]")
        axes.legend()
    return figure


def test_a_picture_is_the_figure(tmp_path):
    found = Image.open(save_figure(drawing(), tmp_path / "ours.png")).convert("RGB")
    with figure_style():
        drawing().savefig(tmp_path / "theirs.png")
    expected = Image.open(tmp_path / "theirs.png").convert("RGB")
    assert found.size == expected.size
    difference = np.asarray(found, float) - np.asarray(expected, float)
    # 128 colours of a line drawing lie some steps of 255 from the many shades of its edges.
    assert np.abs(difference).max() < 32
    assert rms(difference) < 3
