"""Hand-held RGB-D sequences to a 360° scene."""
