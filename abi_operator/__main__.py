"""The command line, as ``python -m abi_operator``."""

from .cli import main

if __name__ == "__main__":
    main("python -m abi_operator")
