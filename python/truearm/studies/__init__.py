"""Studies: the paper's simulations, reproduced and measured."""
