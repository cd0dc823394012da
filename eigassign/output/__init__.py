"""What people and programs see of the results; computes nothing.

In reading order; each imports from those above it only:

    formats        numbers as people read them
    storage        files and folders that are written whole or not at all
    run_record     run.json: the case, version and files of a run, and what has changed since
    run_folder     the folder of a run: hidden until finished; replaces only runs of the same case
    cache          arrays by content key, checked by their hash
    exchange       a reduced model for other programs: NumPy, MATLAB, C99
    reduced_file   a reduced model in one file
    result_files   results.json and the CSV files
    tables         the tables of a run as text
    terminal       the widths of tables that fit a terminal
    console        results on stdout, progress on stderr
    pages          HTML pages from their templates
    batch          what a batch leaves: summaries, junit.xml, columns, index.html
    previous       what an earlier result said, and what has moved since
    figures        the figures of runs, modes and charts, on paper and on screen
    verdict        the first screen of a report
    report         report.html, and what a run or modes leave in a folder
    notebook       figures and tables of a case or result in a notebook
    update_report  the tables and the folder of an update
    chart_report   the tables and the folder of a chart
"""
