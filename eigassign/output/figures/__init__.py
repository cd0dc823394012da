"""Figures: described first, then drawn by matplotlib as files or written for a browser.

In reading order; each imports from those above it only:

    graph      what a graph shows, whoever draws it: curves, shades, rules; its limits
    paper      graphs drawn with matplotlib in one style, and figures as files
    curves     curves over time: what was asked, coordinates, drives
    moves      what moves leave over time, and by motion time
    responses  responses by frequency, and over time
    scene      the mechanism as parts at places: links as thick as their sections, symbols
    mechanism  the parts as curves at one scale: poses, mode shapes
    screen     descriptions as Plotly's data; the scene for a page
    run        the figures of a run: approximation, and which of all there are
"""
