"""Figures of studies, forecasts and checks: one module per group."""
