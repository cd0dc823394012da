"""One case: choices left to auto, optimal design, comparison with exact frequencies.

Reading order:

    results     what a run found, as plain numbers and names: all that the output is given to show
    build       from a case file in which every number is given to its model and trajectories
    planning    expansion point, order and modes; what is left to auto, and where it is judged
    settling    chooses elements and reduced links left to auto, and builds the model
    built_case  a case with its model and trajectories, each built once
    scene       model, trajectory and expansions of a case in one object
    comparison  how good both expansions are: along the trajectory, over the boxes of q and y
    wanted      what the targets ask for, at the samples of the trajectories
    one_shot    the paper's answer: one quadratic program about one expansion point
    response    frequencies along the trajectory and their slopes in the design
    judgement   what a design does to the targets, and the verdict
    clearance   proof that a band stays clear of modes all along a trajectory
    optimum     the design that meets the targets best, by the sequential method
    conclusions  what may be said of an optimum: proved, conflicting limits, what changes nothing
    assignment  from the targets to the answer, by either method
    sensitivity  slopes of the targeted frequencies at the answer, and what its limits cost
    monotone    parameters in which every frequency is monotone, so that corners bound it
    reach       what each target can reach within the bounds, and which cannot be reached
    tolerance   what deviations of the parameters do to an answer
    meaning     what the answer means, as far as the user asks for it
    accuracy    errors of mesh, reduction, expansion and round-off; whether the motion is slow
    drawing     the mechanism as lines and symbols: in poses, and in its modes
    measured    the measurements of a case, each at its pose
    updating    parameters from measured frequencies, with intervals; what is not identified
    collect     all of it put together as the results of a run
"""
