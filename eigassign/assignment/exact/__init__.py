"""The optimum of the exact problem: programs in a row, each judged by exact frequencies.

Reading order:

    design_problem  objective and limits over the design, in units of the bounds
    design_point    a design with its rows, also past kinks; first-order optimality
    step            one program in a trust region, until it misses no rows
    sequential      the steps in a row, the local optimum they lead to; which ends are one
    requirements    a set of requirements as such a problem, also at designs that deviate
    identification  parameters from measured frequencies, their covariance and intervals
    ranges          all parameters that explain frequencies known to lie between two each
"""
