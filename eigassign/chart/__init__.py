"""Time against accuracy of every way to the frequencies of a case, timed on this machine.

Reading order:

    results     what a chart holds, as plain numbers
    timing      how jobs are timed, and the machine
    effort      how much a chart tries, and how long
    question    the points at which every method is asked for frequencies
    methods     what a charted method is, and those of eigassign
    surrogates  interpolation and regression on the unit box
    rivals      what people do without eigassign
    front       which methods no other beats, and what to choose
    comparison  every method put the same question: built, evaluated, timed, compared
    mesh        elements per link against discretisation error
    designs     ways to a design against the objective that each reaches
"""
