"""Regression, embedding and free runs: arrays in, arrays out."""
