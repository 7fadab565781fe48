"""A listener of `machine.listening` that keeps what it is told."""


class Heard:
    """Numbers of columns that were solved, and what was told of compiling."""

    def __init__(self):
        self.columns, self.compiled = [], []

    def solved(self, columns):
        self.columns.append(columns)

    def compiling(self, begins):
        self.compiled.append(begins)
