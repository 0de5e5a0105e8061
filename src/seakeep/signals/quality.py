"""Quality of measured series."""

from __future__ import annotations

MISSING, BRIDGED, OUTLIER, SATURATED, STUCK, REPLACED = 1, 2, 4, 8, 16, 32
FLAGS = {"missing": MISSING, "bridged": BRIDGED, "outlier": OUTLIER, "saturated": SATURATED,
         "stuck": STUCK, "replaced": REPLACED}  # fmt: skip


def flag_attributes(channel: str) -> dict[str, object]:
    """Attributes of a flag variable, by the CF conventions."""
    return {
        "long_name": f"quality flags of {channel}",
        "flag_masks": tuple(FLAGS.values()),
        "flag_meanings": " ".join(FLAGS),
        "units": "1",
    }
