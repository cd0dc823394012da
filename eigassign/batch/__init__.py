"""Many cases in parallel processes.

Reading order:

    variants  the variants of a case: its `sweep`, or what --set says
    plan      which cases, in which order; the name and the key of each
    manifest  what is remembered of each as it finishes, and which plan a folder is of
    workers   processes to run cases in, gone when the parent is
    runner    a folder for each case, and a row of the summary
"""
