"""What several keys of a case file must have in common, checked over its plain data.

The schema sees one part at a time, and stops where a part is wrong. The rules see the whole file as
it is written, so that problems of both kinds are reported at once.

In reading order, each importing only from those above it:

    lookups       what the names in the plain data stand for: nodes, joints, parameters
    properties    design parameters: the number that a path names, and its bounds
    files         files that the case names: whether they can be read; choices listed in one
    values        values whose unit another key decides → SI, before the schema sees them
    links         rules: links, materials, sections, and what stands on nodes
    joints        rules: joints between links, coordinates, loops
    study         rules: trajectory, design, expansion, validation
    targets       rules: targets, the modes they follow, the method that takes them
    consistency   the table of all rules
    plausibility  warnings: what is allowed but looks like a slip
"""
