"""What people and programs see of the results; computes nothing.

In reading order; each imports from those above it only:

    store         files and folders that are written whole or not at all: runs, the cache
    documents     rows as JSON, and the schema of that: results.json
    result_files  the CSV files of a run
    tables        the tables of a run as text
    console       results on stdout
    figures       the figures of runs, modes and charts, on paper and on screen
    reports       report.html, and what runs, updates and charts leave in a folder; notebooks
    batch         what a batch leaves: summaries, junit.xml, index.html
"""

from eigassign.faces import face

__all__, __getattr__, __dir__ = face(
    __name__,
    {
        "batch.index": "index_page write_files",
        "batch.summary": (
            "CaseOutcome batch_table frequency_ranges from_plain summary_json to_plain"
        ),
        "console": "print_assignment print_tables print_verdict",
        "figures.graph": "Curve FigurePlan Graph Look Panel Shade",
        "figures.mechanism": "mode_figures",
        "figures.paper": "draw render",
        "figures.run": "run_figures",
        "figures.screen": "screen_figure",
        "reports.chart": "chart_tables write_chart",
        "reports.page": "page verdict_of write_figures write_run",
        "documents": "NUMBERS results_document to_json",
        "result_files": "sample_files",
        "store.cache": "Cache content_key default_directory",
        "store.run_folder": "is_untouched run_folder",
        "tables": "Table modes_table run_tables validation_table",
    },
)
