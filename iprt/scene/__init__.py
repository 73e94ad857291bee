"""The scene folder: its manifest, footage, objects and edits."""
