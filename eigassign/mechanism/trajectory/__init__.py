"""Trajectories q(t): joint samples, CSV files, points, or a path of the tip.

Read in this order; each imports only from those above it:

    timing      timing laws s(τ), and motion from point to point
    csv         joint samples from a CSV file
    trajectory  the trajectory of a case; several together; rates q̇ and q̈
"""
