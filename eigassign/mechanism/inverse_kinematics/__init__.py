"""Numerical inverse kinematics of any chain, closed loops included.

Read in this order; each imports only from those above it:

    chain   where the tip has to be, when and how turned; where it is, with its Jacobian
    solver  one measure, first guesses, Newton, Levenberg-Marquardt, tracing a path
    follow  from the first sample along the whole path, or why not; how that follows the design
"""
