"""Tables in files: the forms they come in, their cells, and the groups of columns that mean something together."""
