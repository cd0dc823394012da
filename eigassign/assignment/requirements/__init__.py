"""What a case asks of its frequencies: one type from the case file to the report.

Reading order:

    requirement  what all kinds have in common, and the frequencies that they are asked of
    frequency    a mode has a frequency
    lower_limit  a mode does not fall below a frequency
    upper_limit  a mode does not exceed a frequency
    gap          two modes stay apart
    band         no mode is in a band
    named_modes  modes that targets name by their shape
    sampling     the targets of a case at the samples of its trajectories
"""
