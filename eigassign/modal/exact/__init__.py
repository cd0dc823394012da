"""Exact elastic modes of the affine pencil, the rigid-body modes projected out exactly.

In reading order:

    dense     the modes as data, small pencils, and how many modes have mass
    inertia   modes below a frequency, poses that fall or buckle: by pivots alone
    large     large pencils: one sample by Lanczos, many samples together
    solver    the modes of any pencil, their slopes, round-off and clusters
    tracking  a mode followed by its shape, along a path or from where it is named
"""
