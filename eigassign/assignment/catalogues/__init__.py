"""The best combinations of what catalogues list, by branch and bound.

Reading order:

    branching  the tree, over any model whose relaxations can be solved
    linear     the linear model of eqs. (13)–(14), proved
    choosing   the exact problem
"""
