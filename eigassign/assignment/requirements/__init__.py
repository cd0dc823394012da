"""What a case asks for: one type from the case file to the report.

Reading order:

    crossing      two modes that meet: the matrix of both, smooth where each alone has a kink
    requirement   what all kinds have in common, its rows, and the frequencies that they are of
    kinds         what may be asked of modes: a frequency, limits, a gap, a band to keep out of
    quantity      mass, drives, sums of parameters, ways under a force or the weight: within limits
    sampling      what a case asks for, at the samples of its trajectories
"""
