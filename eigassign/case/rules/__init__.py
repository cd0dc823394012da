"""What several keys of a case file must have in common, checked over the typed document.

The schema sees one part at a time; the rules see the whole, once the form of each part is right.

In reading order, each importing only from those above it:

    lookups       what the names in a case stand for: nodes, joints, parameters
    properties    design parameters: the number that a path names, and its bounds
    files         files that the case names: whether they can be read; choices listed in one
    values        rule: values whose unit another key decides
    mechanism     rules: links and what stands on their nodes; joints, coordinates, loops
    study         rules: trajectory, design, expansion; targets, and the method that takes them
    consistency   the table of all rules
    plausibility  warnings: what is allowed but looks like a slip
"""
