"""Conversion of hand-held RGB-D sequences to a 360° scene."""
