"""Mutants: defects planted in copies of the program, which its tests must find."""
