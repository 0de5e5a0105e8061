"""Models for hosts other than Python: C99 sources, FMI 2.0 co-simulation, and ONNX graphs."""

from seakeep.hosts.c import write_c, write_estimator, write_fmu
from seakeep.hosts.graph import write_onnx
from seakeep.hosts.program import start_rows

__all__ = ["start_rows", "write_c", "write_estimator", "write_fmu", "write_onnx"]
