"""How large the demonstration is that tests run: rows and columns of it."""

SIZE = 8
