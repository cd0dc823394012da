"""What several keys of a case file must have in common, checked over its plain data.

In reading order, each importing only from those above it:

    nodes         the named nodes of links
    values        values whose unit another key decides → SI
    links         materials, sections, nodes and matrices of links
    joints        how joints connect the links, and the coordinates that move them
    references    everything that does not fit together
    plausibility  what is allowed but looks like a slip; sections that a design could break
"""
