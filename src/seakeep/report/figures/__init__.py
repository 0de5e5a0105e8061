"""Figures of a study: one module a group, and the list of all that a report shows."""
