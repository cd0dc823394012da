"""Figures through matplotlib's `Figure` and `Axes`, planned first and drawn when they are written.

In reading order; each imports from those above it only:

    style      the style sheet, an empty figure, limits of axes, file formats
    curves     curves over time or one parameter: coordinates, approximation, assignment
    maps       expansion errors over two parameters
    meaning    sensitivities, reach and tolerance, error against mass
    mechanism  links, joints, bodies and springs; poses along the trajectory
    modes      mode shapes
    motion     the mechanism by itself; animations of its motion and of its modes
    run        which figures a run has
    update     measured frequencies against the model, parameters with intervals
    front      time against error of a chart's methods
"""
