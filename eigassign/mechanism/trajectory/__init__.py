"""Trajectories q(t): joint samples, CSV files, points, or a path of the tip.

Read in this order; each imports only from those above it:

    csv         joint samples from a CSV file
    motion      q, q̇ and q̈ at any time: of points by timing laws, of samples, along a path
    trajectory  the trajectory of a case; several together; rates q̇ and q̈
"""
