"""Data-driven models of vessels in waves."""
