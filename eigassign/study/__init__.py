"""One case: choices left to auto, optimal design, comparison with exact frequencies.

Reading order:

    results     what a run found, as plain numbers and names: all that the output is given to show
    build       from a case file in which every number is given to its model and trajectories
    wanted      what the targets ask for, at the samples of the trajectories
    planning    expansion point, order and modes; what is left to auto, and where it is judged
    settling    chooses elements and reduced links left to auto, and builds the model
    built_case  a case with its model and trajectories, each built once
    scene       model, trajectory and expansions of a case in one object
    accuracy    errors of mesh, reduction, expansion and round-off; whether the motion is slow
    comparison  how good both expansions are: along the trajectory, over the boxes of q and y
    design      from the targets to the answer, and the verdict
    meaning     what the answer means, as far as the user asks for it
    drawing     the mechanism as lines and symbols: in poses, and in its modes
    moving      one mode along the trajectory, for a picture that moves
    updating    parameters from measured frequencies
    collect     all of it put together as the results of a run
"""
