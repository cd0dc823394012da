"""Files and folders that are written whole or not at all, whatever happens in between.

In reading order; each imports from those above it only:

    atomic      files and folders that are replaced in one step; what killed writers left
    run_record  run.json: the case, version and files of a run
    run_folder  the folder of a run: hidden until finished; replaces only runs of the same case
    cache       files of arrays by content key
"""
