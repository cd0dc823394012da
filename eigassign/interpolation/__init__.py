"""Polynomial interpolation in several variables: Newton's form at nested nodes, with its error.

Reading order:

    newton       nodes, basis and coefficients on lower sets; the powers f, f², f⁻²
    margin       how large the coefficients next to a lower set will be
    single_axis  one axis: as many values as an accuracy needs, or as are given
    adaptive     several axes: as many values as an accuracy needs
    given        a given number of values on one axis or several
"""
