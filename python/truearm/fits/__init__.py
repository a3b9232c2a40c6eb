"""From measurements to fitted models: what is used, what is asked for, what was found."""
