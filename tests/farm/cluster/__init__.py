"""Tests of films on clusters of dask."""
