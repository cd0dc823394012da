"""What a case asks for: one type from the case file to the report.

Reading order:

    requirement  what all kinds have in common: rows, frequencies, pairs of modes that meet
    kinds        what may be asked of modes: a frequency, limits, a gap, a band to keep out of
    quantity     mass, drives, sums of parameters, ways under a force or the weight: within limits
    residual     vibration that a move leaves
    sampling     what a case asks for, at the samples of its trajectories
"""
