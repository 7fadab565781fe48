"""What a reader says when a file is not what it should be."""


class InputError(ValueError):
    """One sentence: what is wrong with which file, and what to do about it."""
