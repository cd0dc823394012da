"""The search for the design that meets the targets best.

Reading order:

    response  frequencies along the trajectory, their slopes in the design, corners that bound them
    variants  the problem of one choice of what is discrete; its local optima, from several starts
    optimum   the design that meets the targets best, by the sequential method
    lobes     the fastest motion, sought in the basins of residual vibration
"""
