"""Scenes as USD stages, in metres with +Y up."""
