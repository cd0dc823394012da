"""What people and programs see of the results; computes nothing.

In reading order; each imports from those above it only:

    formats       numbers as people read them
    store         files and folders that are written whole or not at all: runs, the cache
    exchange      a reduced model in files: HDF5, NumPy, MATLAB, C99
    result_files  results.json and the CSV files
    tables        the tables of a run as text
    console       results on stdout, progress on stderr
    pages         HTML pages from their templates
    batch         what a batch leaves: summaries, junit.xml, columns, index.html
    previous      what an earlier result said, and what has moved since
    figures       the figures of runs, modes and charts, on paper and on screen
    reports       report.html, and what runs, updates and charts leave in a folder; notebooks
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "batch.files": "NAMES are_current merge_files write_files",
        "batch.junit": "Junit",
        "batch.outcome": "CaseOutcome Status frequency_ranges from_line ranges to_line",
        "batch.summary": "COLUMNS SummaryCsv SummaryJson batch_table",
        "store.cache": "Cache DamagedError HEADER_BYTES default_directory header key pack unpack",
        "reports.chart": "chart_tables write_chart",
        "exchange.files": "write_exchange",
        "figures.front": "chart_figures",
        "figures.graph": "Curve FigurePlan Graph Look Panel Shade",
        "figures.mechanism": (
            "diameters draw_links extent length_label line_widths points_of round_length view_of"
        ),
        "figures.motion": "mode_figures thumbnail",
        "figures.paper": "draw render",
        "figures.run": "run_figures",
        "formats": "number percent residual seconds",
        "previous": "Comparison Known of_outcome of_validation read_previous",
        "exchange.reduced_file": "load_reduced",
        "reports.page": "write_modes write_run",
        "result_files": "dumps frequencies_csv results_document sample_files to_json",
        "store.run_folder": "run_folder",
        "store.run_record": "MARKER RunStatus changes read_record run_status",
        "store.atomic": "lock replace_synced",
        "console": "print_assignment print_tables print_verdict progress wrapped",
        "tables": "Table headline modes_table run_tables validation_table",
    },
)
