"""Values that the text of a program alone does not give."""


class Unresolved(Exception):
    """A value that the text does not give, so that a motion stays as it is; the message says why, for the user."""
