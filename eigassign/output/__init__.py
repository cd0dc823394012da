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

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "batch.files": "NAMES are_current merge_files write_files",
        "batch.junit": "Junit",
        "batch.outcome": "CaseOutcome Status frequency_ranges from_line ranges to_line",
        "batch.summary": "COLUMNS SummaryCsv SummaryJson batch_table",
        "cache": "Cache DamagedError HEADER_BYTES default_directory header key pack unpack",
        "chart_report": "write_chart",
        "exchange.files": "write_exchange",
        "figures.front": "MethodLine chart_figures scatter",
        "figures.graph": "Curve FigurePlan Graph Look Panel Shade",
        "figures.mechanism": (
            "diameters draw_links extent length_label line_widths points_of round_length view_of"
        ),
        "figures.modes": "mode_figures thumbnail",
        "figures.paper": "draw render",
        "figures.run": "run_figures",
        "formats": "number percent residual seconds",
        "previous": "Comparison Known of_outcome of_validation read_previous",
        "reduced_file": "load_reduced",
        "report": "write_modes write_run",
        "result_files": "dumps frequencies_csv results_document sample_files to_json",
        "run_record": "MARKER RunStatus changes read_record run_status",
        "storage": "lock replace_synced",
        "tables": "Table headline",
    },
)
