"""Preparation of a video's frames; `stages` lists the stages in order."""
