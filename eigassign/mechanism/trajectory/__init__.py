"""Trajectories q(t): joint samples, CSV files, points, or a path of the tip.

Read in this order; each imports only from those above it:

    motion      q, q̇ and q̈ at any time: of points, of samples, of a tip
    trajectory  the trajectory of a case, from CSV files too; several together; rates q̇ and q̈
"""
