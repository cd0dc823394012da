"""The checks of an answer: what is said about it, each from a scene and a design to rows and words.

Reading order:

    slow_motion  what the motion itself changes, which the frequencies of still poses do not contain
    weight       what gravity changes that is not in the frequencies
    accuracy     what mesh and reduced links change, and all errors of a run side by side
"""
