"""What a batch leaves beside the folders of its cases: made from one row a case, in its order.

In reading order; each imports from those above it only:

    outcome  how one case ended: a row of every file below
    summary  summary.csv, summary.json and junit.xml, and the table on the console
    index    index.html: plots over what was swept, the rows to sort and filter; all files together
"""
