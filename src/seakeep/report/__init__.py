"""Figures, tables and pages; the only package that imports matplotlib."""
