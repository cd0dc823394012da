"""Assign the natural frequencies of moving, flexible mechanisms along their trajectory."""

from eigassign._version import __version__

__all__ = ["__version__"]
