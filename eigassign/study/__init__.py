"""Many evaluations of the layers to the left, compared with one another."""
