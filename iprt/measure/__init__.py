"""Measurement of speed, accuracy and stability, and its reports."""
