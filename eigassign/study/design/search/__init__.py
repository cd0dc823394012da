"""The search for the design that meets the targets best.

Reading order:

    response  frequencies along the trajectory, their slopes in the design, corners that bound them
    variants  the problems that the targets make, one for each choice that bands leave
    starts    the local optima of one of them, from several starts
    optimum   the design that meets the targets best, by the sequential method
"""
