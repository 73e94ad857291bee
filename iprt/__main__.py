"""`python -m iprt`: the same as the command `iprt`."""

from iprt.cli import command

if __name__ == "__main__":
    command()
