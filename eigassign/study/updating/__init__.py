"""Parameters from measured frequencies.

Reading order:

    measured  the measurements of a case, each at its pose
    fit       the parameters that explain them, with intervals; what is not identified
    updated   the case that an update leaves, with what is uncertain
"""
