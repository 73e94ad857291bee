"""Clipped lights: grouped, how they shade surfaces, and how much brighter they must be."""
