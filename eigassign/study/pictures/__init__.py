"""What is drawn of a mechanism, as plain lines and numbers.

Reading order:

    drawing  the mechanism as lines and symbols: in poses, and in its modes
    moving   one mode along the trajectory, for a picture that moves
"""
