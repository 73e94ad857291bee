"""Estimation of the sky behind windows in directions that no camera saw."""
