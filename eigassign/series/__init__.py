"""Truncated power series over any lower set of multi-indices; knows no mechanics."""
