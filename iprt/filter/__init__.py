"""Filtering of sparse, noisy signals: tracing mask, interpolation, accumulation, à-trous."""
