"""What a batch leaves beside the folders of its cases: made from one row a case, in its order.

In reading order; each imports from those above it only:

    summary  how one case ended, a row of every file; summary.csv, summary.json and junit.xml
    index    index.html: plots over what was swept, the rows to sort and filter; all files together
"""
