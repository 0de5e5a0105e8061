"""Numbers that the paper publishes, printed beside ours in a column of their own.

They come from measurements of another vessel in another tank, which are not public: they are for
orientation, and nothing is tuned to them.
"""

from __future__ import annotations

__all__ = ["JSD_MEAN", "PUBLISHED"]

PUBLISHED = {
    "surge": "0.0026",
    "heave": "0.0031",
    "pitch": "0.0035",
    "surge_rate": "0.0021",
    "heave_rate": "0.0036",
    "pitch_rate": "0.0041",
    "surge_acceleration": "0.0045",
    "heave_acceleration": "0.0071",
    "pitch_acceleration": "0.0086",
    "mooring_bow": "0.0186",
    "mooring_stern": "0.0274",
}
"""Expected value of the divergence by channel, BHDMDc, CK-14e in irregular waves (paper, Table)."""

JSD_MEAN = "0.0077 [0.0040, 0.0139]"
"""Average over the channels, with q0.025 and q0.975."""
