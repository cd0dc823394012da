"""From the targets of a case to its answer, and the verdict.

Reading order:

    followed     modes that targets follow by their shape, at any design
    lists        lists that parameters take their values from, and what a design costs
    judgement    what a design does to the targets, and the verdict, a function of what a run found
    clearance    whether a band stays clear of modes all along a trajectory
    search       the design that meets the targets best, from several starts
    conclusions  what may be said of an optimum, and what an objective that is no error has come to
    robust       the same for every deviation within tolerances
    answer       the answer by either method
    account      these facts, how the answer was found, and what holds it back
"""
