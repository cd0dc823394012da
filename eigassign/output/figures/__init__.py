"""Figures: described first, then drawn by matplotlib as files or written for a browser.

In reading order; each imports from those above it only:

    graph      what a graph shows, whoever draws it: curves, shades, bars, maps; its limits
    style      matplotlib: the style sheet, an empty figure, file formats
    paper      descriptions drawn with matplotlib, and figures as files
    screen     descriptions as Plotly's data, their tables, a mode that moves
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
