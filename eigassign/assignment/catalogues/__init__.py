"""The best combinations of what catalogues list, one by one or by branch and bound.

Reading order:

    branching  the tree, over any model whose relaxations can be solved
    choosing   the program of eqs. (13)–(14), proved, and the exact problem
"""
