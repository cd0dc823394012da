"""Many cases in parallel processes.

Reading order:

    workers  processes to run cases in, gone when the parent is
    runner   which cases, a folder for each, and a row of the summary for each
"""
