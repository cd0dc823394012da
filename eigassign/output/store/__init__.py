"""Files and folders that are written whole or not at all, whatever happens in between.

In reading order; each imports from those above it only:

    atomic      files and folders that are replaced in one step; what killed writers left
    run_folder  the folder of a run, hidden until finished, and its run.json
    cache       files of arrays by content key
"""
