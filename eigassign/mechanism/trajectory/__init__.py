"""Trajectories q(t): joint samples, CSV files, points, or a path of the tip.

Read in this order; each imports only from those above it:

    timing      timing laws s(τ), and when points are reached
    csv         joint samples from a CSV file
    motion      q, q̇ and q̈ at any time: of points, of samples, along a path of the tip
    trajectory  the trajectory of a case; several together; rates q̇ and q̈
"""
