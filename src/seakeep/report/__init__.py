"""Figures and tables; the only rooms that know matplotlib."""
