"""Elements, reduced links, order and expansion points: the least that meets an accuracy.

Reading order:

    cheapest        the loop that takes the cheapest of what is tried
    mesh            elements of each link, judged by what their mesh leaves out
    link_reduction  the frequency up to which links keep their fixed-interface modes
    order           order and expansion points of the Taylor polynomial, judged by exact solves
"""
