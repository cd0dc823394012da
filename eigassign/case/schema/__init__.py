"""What each key of a case file may hold: one pydantic model for each part.

In reading order, each importing only from those above it:

    parts       quantities, names and vectors that the parts of a case file share
    links       the keys `materials`, `sections` and `links`; the shapes of sections
    mechanism   joints, bodies, springs, drives, coordinates, and the mechanism as a whole
    trajectory  the key `trajectory`
    design      the key `design`: parameters, catalogues, limits, and the one vector y they make
    uncertain   the key `uncertain`: properties that are not known exactly
    targets     the key `targets`
    study       the keys `assignment`, `expansion`, `validation`, `measurements` and `sweep`
    document    the whole case file, its errors as readable findings, its JSON Schema
"""
