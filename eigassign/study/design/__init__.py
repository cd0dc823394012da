"""From the targets of a case to its answer, and the verdict.

Reading order:

    followed     modes that targets follow by their shape, at any design
    one_shot     the paper's answer: one quadratic program about one expansion point
    response     frequencies along the trajectory and their slopes in the design
    judgement    what a design does to the targets
    clearance    whether a band stays clear of modes all along a trajectory
    variants     the problems that the targets make, one for each choice that bands leave
    starts       the local optima of one of them, from several starts
    optimum      the design that meets the targets best, by the sequential method
    conclusions  what may be said of an optimum: proved, conflicting limits, what changes nothing
    answer       the answer by either method
    verdict      the word for it, its reason and shortcoming, of the facts alone
    account      these facts, how the answer was found, and what holds it back
"""
