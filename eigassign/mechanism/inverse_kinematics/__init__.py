"""Numerical inverse kinematics of any chain, closed loops included.

Read in this order; each imports only from those above it:

    tip_path  where the tip has to be and how it is turned: paths, attitudes, both with their times
    chain     the tip as a function of the mechanism's state, with its Jacobian
    solver    one measure, first guesses, Newton, Levenberg-Marquardt, tracing a path
    follow    from the first sample along the whole path, or why not; how that follows the design
"""
