"""What several keys of a case file must have in common, checked over the typed document.

The schema sees one part at a time; the rules see the whole, once the form of each part is right.

In reading order, each importing only from those above it:

    properties    the number that a path names, what it may be, and values whose unit it decides
    mechanism     rules: links and what stands on their nodes; joints, coordinates, loops
    consistency   files that the case names; rules of the whole case, and the table of all
    plausibility  bounds of nothing that exists; warnings: what is allowed but looks like a slip
"""
