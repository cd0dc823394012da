"""What runs, updates and charts leave for people: a page, and what a notebook shows.

In reading order; each imports from those above it only:

    page      report.html from its first screen on, pages, and what a run or modes leave in a folder
    notebook  figures and tables of a case or result in a notebook
    update    the figures, the tables and the folder of an update
    chart     the figures, the tables and the folder of a chart
    compare   runs side by side on a page
"""
