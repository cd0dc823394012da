"""Elements, reduced links, order and expansion points: the least that meets an accuracy.

Reading order:

    mesh       elements of each link, judged by a twice finer mesh
    reduction  the frequency up to which links keep their fixed-interface modes
    order      order and expansion points of the Taylor polynomial, judged by its error estimate
"""
