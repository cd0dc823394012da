"""The checks of an answer: what is said about it, each from a scene and a design to rows and words.

Reading order:

    mesh         what mesh and reduced links change, by twice the elements and by whole links
    slow_motion  what the motion itself changes, which the frequencies of still poses do not contain
    weight       what gravity changes that is not in the frequencies
    accuracy     what a run states of mesh, reduced links, weight and round-off, side by side
"""
