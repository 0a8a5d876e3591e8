"""The studio: a local web application over the command line, whose state is a folder of plain files."""
