"""What is drawn of a mechanism, as plain lines and numbers.

Reading order:

    drawing  the mechanism as lines and symbols: in poses, in its modes, and moving
"""
