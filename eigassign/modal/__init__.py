"""Exact modes, their Taylor expansion, and what follows from them."""
