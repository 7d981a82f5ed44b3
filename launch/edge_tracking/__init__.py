"""A robot follows an edge by touch: the whole graph, its demo and its report."""
