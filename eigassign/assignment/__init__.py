"""Targets, the quadratic program of eqs. (13)-(14), and the certificate of its solution."""
