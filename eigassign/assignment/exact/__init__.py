"""The optimum of the exact problem: programs in a row, each judged by exact frequencies.

Reading order:

    crossing        two modes that meet: the matrix of both, smooth where each alone has a kink
    design_problem  objective and limits over the design, in units of the bounds
    stationarity    first-order optimality, also where modes meet
    step            one program in a trust region, and what is expected of its step
    sequential      the steps in a row, and the local optimum that they lead to
    requirements    targets and inequalities on frequencies and quantities as such a problem
    identification  parameters from measured frequencies, their covariance and intervals
"""
